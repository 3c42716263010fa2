"""Tables of lanes: where drivers fail, the worst lanes, how severe contacts are, and what no case covers."""
