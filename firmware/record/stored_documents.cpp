#include "firmware/record/stored_documents.h"

#include <fmt/format.h>

#include "firmware/storage/file_pieces.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

Result<take::Manifest> stored_manifest(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kManifestFile;
  FilePieces pieces(disk, name);
  return take::parse_manifest([&] { return pieces.next_text(); }, name);
}

Result<Sha256> stored_manifest_id(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kManifestFile;
  Sha256Stream hash;
  FilePieces pieces(disk, name);
  NODAL_TRY(for_each_piece(pieces, [&](std::span<const std::uint8_t> bytes) {
    hash.update(bytes);
    return pieces.at() <= take::kMaxManifestBytes;
  }));
  if (pieces.at() > take::kMaxManifestBytes)
    return fail(Errc::kTooLarge, fmt::format("file '{}': has more than {} bytes", name, take::kMaxManifestBytes));
  return hash.finish();
}

Result<take::TakeDocument> stored_take_json(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kTakeFile;
  NODAL_TRY_ASSIGN(const auto text, disk.read(name, take::kMaxTakeJsonBytes));
  return take::parse_take_json({reinterpret_cast<const char*>(text.data()), text.size()}, name);
}

Result<take::Segment> stored_evidence(hal::DiskPort& disk, const std::string& name) {
  take::EvidenceReader reader(name);
  FilePieces pieces(disk, name);
  NODAL_TRY(for_each_piece(pieces, [&](std::span<const std::uint8_t> bytes) { return reader.add(bytes).has_value(); }));
  return std::move(reader).finish();
}

}  // namespace nodal::firmware
