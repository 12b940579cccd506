"""One ride from one command: start the nodes, bring them up in order, record, take them down, report."""
