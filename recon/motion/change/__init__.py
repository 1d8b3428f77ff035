"""What changed: surfaces that left their place or came to it, told by depth alone, without a track."""
