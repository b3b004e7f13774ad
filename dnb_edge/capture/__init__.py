"""Where frames come from: cameras, files, recordings and the simulator, as peers behind one protocol."""
