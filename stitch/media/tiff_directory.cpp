#include "stitch/media/tiff_directory.h"

namespace nodal::media {

namespace {
constexpr std::size_t kEntryBytes = 12;
constexpr std::uint32_t kShort = 3;  // type of numbers of 16 bits (TIFF 6.0, section 2)
}  // namespace

TiffDirectory::TiffDirectory(std::span<const std::uint8_t> file)
    : file_(file), little_(!file.empty() && file[0] == 'I') {
  if (const std::optional<std::uint32_t> at = number(4, 4)) open(*at);
}

void TiffDirectory::open(std::size_t at) {
  const std::optional<std::uint32_t> entries = number(at, 2);
  first_ = at + 2;
  count_ = entries.value_or(0);
}

std::optional<std::uint32_t> TiffDirectory::find(std::uint32_t tag) const {
  for (std::size_t k = 0; k < count_; ++k) {
    const std::size_t at = first_ + k * kEntryBytes;
    const std::optional<std::uint32_t> name = number(at, 2), type = number(at + 2, 2);
    if (!name || !type) return std::nullopt;
    if (*name == tag) return number(at + 8, *type == kShort ? 2 : 4).value_or(0);
  }
  return std::nullopt;
}

std::optional<TiffDirectory> TiffDirectory::linked(std::uint32_t tag) const {
  const std::optional<std::uint32_t> at = find(tag);
  if (!at) return std::nullopt;
  TiffDirectory other = *this;
  other.open(*at);
  return other;
}

std::optional<std::uint32_t> TiffDirectory::number(std::size_t at, std::size_t bytes) const {
  if (at > file_.size() || file_.size() - at < bytes) return std::nullopt;
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < bytes; ++k) value = value << 8 | file_[at + (little_ ? bytes - 1 - k : k)];
  return value;
}

}  // namespace nodal::media
