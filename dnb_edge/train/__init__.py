"""Making the detector's model: data synthesis, network, training and quantisation. Needs the extra `train`."""
