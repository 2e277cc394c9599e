"""A robot read from its files: XML, xacro, links and joints, the tree and its coupling, and it as Pinocchio's model."""
