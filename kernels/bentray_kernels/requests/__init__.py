"""Names, ranges and limits of what users may ask for, checked alike by every interface."""
