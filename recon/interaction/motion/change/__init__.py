"""What changed: surfaces that left their place or came to it, by depth alone, without tracks."""
