"""The water shot of a scan that has none, estimated from the chords that miss the object."""
