"""What cameras deliver of an exact rendering: five kinds of depth cameras and one of colour."""
