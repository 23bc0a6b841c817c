#include <algorithm>
#include <utility>

#include "firmware/record/recovery.h"
#include "protocol/framing.h"
#include "protocol/take/digest.h"

namespace nodal::firmware {
namespace {

using take::PieceHashes;

/// Calls `each` with the file's bytes, at most `end`, a MiB at a time, until it returns false.
template <class Each>
Status for_each_piece(hal::DiskPort& disk, const std::string& name, std::uint64_t end, Each each) {
  const auto file = disk.open_read(name);
  if (!file) return fail(file.error());
  std::vector<std::uint8_t> piece(PieceHashes::kPiece);
  Status good;
  for (std::uint64_t from = 0; from < end;) {
    const std::span<std::uint8_t> into =
        std::span(piece).first(static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), end - from)));
    const auto read = disk.read_at(*file, from, into);
    if (!read) good = fail(read.error());
    if (!read || *read == 0 || !each(std::span<const std::uint8_t>(into.first(*read)))) break;
    from += *read;
  }
  disk.close(*file);
  return good;
}

}  // namespace

Result<std::optional<take::Manifest::File>> recover_flight(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kFlightFile;
  const auto size = disk.size(name);
  if (!size && size.error().code == Errc::kNotFound) return std::optional<take::Manifest::File>();
  if (!size) return fail(size.error());
  std::uint64_t seen = 0;
  std::uint64_t whole = 0;
  FrameDecoder decoder;
  const Status scanned = for_each_piece(disk, name, *size, [&](std::span<const std::uint8_t> rest) {
    seen += rest.size();
    while (!rest.empty()) {
      const auto frame = decoder.next(rest);
      if (!frame) return false;
      if (*frame) whole = seen - rest.size();
    }
    return true;
  });
  if (!scanned) return fail(scanned.error());
  if (whole == 0) {
    if (const Status removed = disk.remove(name); !removed) return fail(removed.error());
    return std::optional<take::Manifest::File>();
  }
  if (whole != *size) {
    const auto file = disk.open_append(name);
    if (!file) return fail(file.error());
    const Status cut = disk.truncate(*file, whole);
    disk.close(*file);
    if (!cut) return fail(cut.error());
  }
  PieceHashes hashes;
  const Status hashed = for_each_piece(disk, name, whole, [&](std::span<const std::uint8_t> bytes) {
    hashes.update(bytes);
    return true;
  });
  if (!hashed) return fail(hashed.error());
  return std::optional<take::Manifest::File>({take::kFlightFile, whole, take::digest_of(hashes.all())});
}

}  // namespace nodal::firmware
