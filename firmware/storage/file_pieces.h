// A file of any length in pieces of a MiB.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Reads a part of a file from its front to its end. Needs the memory of one piece, however long the file is or claims
/// to be.
///
/// Threading: thread-bound.
/// Ownership: the disk outlives it; opens the file at the first piece, closes it with the last one, an error, or its
/// end.
/// Errors: the disk's.
class FilePieces {
 public:
  static constexpr std::size_t kPiece = std::size_t{1} << 20;
  static constexpr std::uint64_t kAll = std::numeric_limits<std::uint64_t>::max();

  FilePieces(hal::DiskPort& disk, std::string name, std::uint64_t from = 0, std::uint64_t to = kAll)
      : disk_(disk), name_(std::move(name)), at_(from), end_(to) {}
  ~FilePieces() { close(); }
  FilePieces(const FilePieces&) = delete;
  FilePieces& operator=(const FilePieces&) = delete;

  /// The next piece, valid until the next call; an empty one at the file's end, or at `to`.
  Result<std::span<const std::uint8_t>> next();
  /// The same as text.
  Result<std::string_view> next_text();
  /// Position of the next piece in the file, bytes.
  std::uint64_t at() const { return at_; }

 private:
  void close();

  hal::DiskPort& disk_;
  const std::string name_;
  std::uint64_t at_;
  const std::uint64_t end_;
  std::optional<hal::FileHandle> file_;
  std::vector<std::uint8_t> piece_;
};

/// Calls `each` with piece after piece until it returns false. Errors: the disk's.
Status for_each_piece(FilePieces& pieces, const std::function<bool(std::span<const std::uint8_t>)>& each);

}  // namespace nodal::firmware
