"""Where two bodies touch: times of contacts of balls, cushions and pockets."""
