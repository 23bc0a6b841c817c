// How long one `nodal` waits while other hosts keep what it asks for.
#pragma once

#include <string>

namespace nodal::crash {

/// For every kind of request and several numbers of hosts that make it without a pause: runs `nodal` with every command
/// that reads, and with every one that needs something exclusive, and prints the longest wait of each kind. With
/// `timed`, reads must be answered within 2 s and exclusive requests within 10 s, both more than without other hosts.
/// `quick`: with 11 hosts alone, all that the rig accepts beside one. `kind`: only requests of this kind, by its name
/// in the table; empty: all. Returns the number of failures.
int run_turns(bool timed, bool quick, const std::string& kind);

}  // namespace nodal::crash
