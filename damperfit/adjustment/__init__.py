"""What shows only across settings: trends, forces at a speed, clicks, the setting for a force."""
