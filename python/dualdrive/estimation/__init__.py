"""What every estimate stands on: unknowns with their priors, and the numbers that decide."""
