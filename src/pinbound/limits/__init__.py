"""How far one coordinate can move: contact angles in closed form, else isolated with proof."""
