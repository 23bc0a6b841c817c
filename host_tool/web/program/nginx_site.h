// The site of nginx that ends TLS for nodal-web.
#pragma once

#include <string>
#include <vector>

namespace nodal::host::web {

struct Site {
  std::vector<std::string> listen;  ///< "443", "[::]:443"
  std::vector<std::string> names;
  std::string certificate, key, socket;  ///< files
};

/// The first line of its file, by which it is known.
inline constexpr const char* kSiteMark = "# Written by `nodal-web front enable`; `nodal-web front disable` removes it.";

std::string nginx_site(const Site& site);

}  // namespace nodal::host::web
