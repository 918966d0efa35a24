"""Which structure the logs support: candidates fitted alike, compared, and put into words."""
