"""How far one coordinate can move: contact angles in closed form, or else isolated with proof."""
