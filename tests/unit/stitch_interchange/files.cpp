#include "files.h"

#include <fstream>
#include <sstream>

namespace nodal::interchange {

std::optional<std::string> shared_file(const std::string& path) {
  std::ifstream in(std::string(NODAL_SHARED_DIR) + "/data/" + path, std::ios::binary);
  if (!in) return std::nullopt;
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

}  // namespace nodal::interchange
