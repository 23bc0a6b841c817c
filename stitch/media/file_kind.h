// What a file is that is no picture which Nodal reads: told by its first bytes, then by its name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace nodal::media {

/// As many bytes from a file's beginning as file_kind() looks at.
inline constexpr std::size_t kFileKindBytes = 64 * 1024;

struct FileKind {
  std::string_view one;     ///< "an HEIF file"
  std::string_view many;    ///< "HEIF files"
  std::string_view advice;  ///< what to do, as an imperative; may be empty
  bool pictures = false;    ///< it holds pictures or a film, which people give in place of a picture
  /// Hosts read it (heif_webp/); nodald, which does not link those libraries, refuses it.
  bool read_by_hosts = false;
};

/// `head`: the file's first bytes, all of them or kFileKindBytes; `name`: its name or path. Null for a JPEG, a PNG, and
/// a TIFF that is not a camera's raw file.
const FileKind* file_kind(std::span<const std::uint8_t> head, std::string_view name);

/// Whether a file with these first bytes is a TIFF or BigTIFF of either byte order, a camera's raw file among them.
bool begins_like_tiff(std::span<const std::uint8_t> head);

/// "an HEIF file: convert it to JPEG or PNG (...)".
std::string text_of(const FileKind& kind);

}  // namespace nodal::media
