"""What is tested: whose damper, and where its adjusters stand."""
