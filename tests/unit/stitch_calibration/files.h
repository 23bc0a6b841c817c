// Test files from beside the checkout.
#pragma once

#include <fstream>
#include <optional>
#include <sstream>
#include <string>

namespace nodal::calibration {

/// A file below the shared folder; nothing when it is not there.
inline std::optional<std::string> shared_file(const std::string& path) {
  std::ifstream in(std::string(NODAL_SHARED_DIR) + "/data/" + path, std::ios::binary);
  if (!in) return std::nullopt;
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

}  // namespace nodal::calibration

/// Declares `name` with the file's text, or skips the test and says so.
#define NODAL_SHARED_FILE_OR_SKIP(name, path)                                                   \
  const std::optional<std::string> name##_if_there = nodal::calibration::shared_file(path);     \
  if (!name##_if_there) GTEST_SKIP() << "test data not there: ../shared/data/" << (path);       \
  const std::string& name = *name##_if_there
