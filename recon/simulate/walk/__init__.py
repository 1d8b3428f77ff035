"""Random walks: a furnished room, and a person who goes from piece to piece, opens and closes fronts."""
