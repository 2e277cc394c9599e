"""A robot read from its files: XML, xacro, links and joints, the tree with its coupling, and the Pinocchio model."""
