"""Routes of uploads: resumable (tus), directly to the store, and in one request, with their metadata."""
