"""What the kit prints: roof markers, floor markers, calibration boards and whole tracks, on paper and to scale."""
