// Test data from outside the checkout.
#pragma once

#include <optional>
#include <string>

namespace nodal::interchange {

/// Reads a file below the shared folder's data/; nothing if it does not exist.
std::optional<std::string> shared_file(const std::string& path);

}  // namespace nodal::interchange

/// Declares `name` with the file's text, or skips the test with a message.
#define NODAL_SHARED_FILE_OR_SKIP(name, path)                                               \
  const std::optional<std::string> name##_if_there = nodal::interchange::shared_file(path); \
  if (!name##_if_there) GTEST_SKIP() << "test data not there: ../shared/data/" << (path);   \
  const std::string& name = *name##_if_there
