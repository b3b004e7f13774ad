"""What the system tests share: the guest's image, the guest itself, and a USB webcam played in user space. See ../README.md."""
