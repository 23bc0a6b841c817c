// Where the files of a take are.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::media {

/// A file of a take, open for reading.
///
/// Threading: thread-bound.
/// Errors: each names the file.
class TakeFile {
 public:
  virtual ~TakeFile() = default;
  /// When it was opened.
  virtual std::uint64_t size() const = 0;
  /// Fills `bytes` from there on. kTruncated if the file ends before.
  virtual Status read(std::uint64_t at, std::span<std::uint8_t> bytes) = 0;
};

/// The folder of a take, on any disk. What is not a plain file (a symbolic link, a device) counts as not there, because
/// the folder may come from anywhere.
///
/// Threading: thread-bound.
/// Ownership: outlives the files that it opens.
class TakeFiles {
 public:
  virtual ~TakeFiles() = default;
  /// Errors: kNotFound, and those of the disk; each names the file.
  virtual Result<std::unique_ptr<TakeFile>> open(const std::string& name) = 0;
  /// The name in messages to people: with the folder. Empty `name`: the folder itself.
  virtual std::string shown(const std::string& name) const = 0;
};

/// Ends the names of files of a copy that are not whole, or not compared with their hashes yet.
inline constexpr std::string_view kPartSuffix = ".part";

/// The manifest of a take. Errors: also kNotReady for a copy that is not complete, and for a take that was not ended.
Result<std::vector<std::uint8_t>> read_manifest_file(TakeFiles& files);

/// All of a file. Errors: those of TakeFiles; kTooLarge.
Result<std::vector<std::uint8_t>> read_take_file(TakeFiles& files, const std::string& name, std::uint64_t limit);

}  // namespace nodal::media
