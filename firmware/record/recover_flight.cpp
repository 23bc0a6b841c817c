#include "firmware/record/recovery.h"
#include "firmware/storage/file_pieces.h"
#include "protocol/base/try.h"
#include "protocol/framing.h"
#include "protocol/take/digest.h"

namespace nodal::firmware {
using take::PieceHashes;

Result<std::optional<take::Manifest::File>> recover_flight(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kFlightFile;
  const auto size = disk.size(name);
  if (!size && size.error().code == Errc::kNotFound) return std::optional<take::Manifest::File>();
  if (!size) return fail(size.error());
  std::uint64_t seen = 0;
  std::uint64_t whole = 0;
  FrameDecoder decoder;
  FilePieces all(disk, name, 0, *size);
  NODAL_TRY(for_each_piece(all, [&](std::span<const std::uint8_t> rest) {
    seen += rest.size();
    while (!rest.empty()) {
      const auto frame = decoder.next(rest);
      if (!frame) return false;
      if (*frame) whole = seen - rest.size();
    }
    return true;
  }));
  if (whole == 0) {
    NODAL_TRY(disk.remove(name));
    return std::optional<take::Manifest::File>();
  }
  if (whole != *size) {
    NODAL_TRY_ASSIGN(const auto file, disk.open_append(name));
    const Status cut = disk.truncate(file, whole);
    disk.close(file);
    if (!cut) return fail(cut.error());
  }
  PieceHashes hashes;
  FilePieces kept(disk, name, 0, whole);
  NODAL_TRY(for_each_piece(kept, [&](std::span<const std::uint8_t> bytes) {
    hashes.update(bytes);
    return true;
  }));
  return std::optional<take::Manifest::File>({take::kFlightFile, whole, take::digest_of(hashes.all())});
}

}  // namespace nodal::firmware
