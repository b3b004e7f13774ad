"""What recordings say: listed, raced again with edits and other rules, judged, compared, exported."""
