"""One thread of OpenCV, as in the campaign's processes."""

import cv2

cv2.setNumThreads(1)
