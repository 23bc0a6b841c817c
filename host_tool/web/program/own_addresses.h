// The names and addresses of this computer.
#pragma once

#include <string>
#include <vector>

namespace nodal::host::web {

/// Whether a text is an address of IPv4 or IPv6, without brackets or a port.
bool is_address(const std::string& text);

/// The addresses of its network interfaces that are up, without loopback and link-local ones; IPv4 first.
std::vector<std::string> own_addresses();

/// Its name, and the name with .local, in lower case; none if it has no name.
std::vector<std::string> own_names();

std::string in_lower_case(std::string text);

}  // namespace nodal::host::web
