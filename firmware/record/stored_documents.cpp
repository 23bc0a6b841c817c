#include "firmware/record/stored_documents.h"

#include <fmt/format.h>

#include "firmware/storage/file_pieces.h"

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
  const Status read = for_each_piece(pieces, [&](std::span<const std::uint8_t> bytes) {
    hash.update(bytes);
    return pieces.at() <= take::kMaxManifestBytes;
  });
  if (!read) return fail(read.error());
  if (pieces.at() > take::kMaxManifestBytes)
    return fail(Errc::kTooLarge, fmt::format("file '{}': has more than {} bytes", name, take::kMaxManifestBytes));
  return hash.finish();
}

Result<take::TakeDocument> stored_take_json(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kTakeFile;
  const auto text = disk.read(name, take::kMaxTakeJsonBytes);
  if (!text) return fail(text.error());
  return take::parse_take_json({reinterpret_cast<const char*>(text->data()), text->size()}, name);
}

Result<take::Segment> stored_evidence(hal::DiskPort& disk, const std::string& name) {
  take::EvidenceReader reader(name);
  FilePieces pieces(disk, name);
  const Status read =
      for_each_piece(pieces, [&](std::span<const std::uint8_t> bytes) { return reader.add(bytes).has_value(); });
  if (!read) return fail(read.error());
  return std::move(reader).finish();
}

}  // namespace nodal::firmware
