"""Members stepped at the same time, by threads of this process or in processes of their own."""
