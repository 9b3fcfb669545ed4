"""Standard deviation and resolution width of an image, from the linearised problem at that image."""
