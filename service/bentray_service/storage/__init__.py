"""What outlives the process: the database rows and the files of the service."""
