#include "stitch/media/tiff/exif_block.h"

#include <algorithm>
#include <array>
#include <optional>

namespace nodal::media {
namespace {

constexpr std::uint16_t kMake = 271, kModel = 272, kDateTime = 306, kExifDirectory = 34665, kGpsDirectory = 34853;
constexpr std::uint16_t kMakerNote = 37500, kInterop = 40965;  ///< with offsets of their own
constexpr std::uint16_t kLong = 4;
/// Bytes of a value by its type (TIFF 6.0, section 2).
constexpr std::array<std::size_t, 13> kTypeBytes{0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};
constexpr std::size_t kEntryBytes = 12;

struct Entry {
  std::uint16_t tag = 0, type = 0;
  std::uint32_t count = 0;
  std::vector<std::uint8_t> value{};  ///< in the file's byte order
};

/// Numbers of a file's byte order.
class Order {
 public:
  explicit Order(bool big_endian) : big_(big_endian) {}
  std::uint32_t read(std::span<const std::uint8_t> bytes) const {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < bytes.size(); ++k) value |= std::uint32_t{bytes[k]} << shift(k, bytes.size());
    return value;
  }
  void write(std::uint32_t value, std::span<std::uint8_t> to) const {
    for (std::size_t k = 0; k < to.size(); ++k) to[k] = static_cast<std::uint8_t>(value >> shift(k, to.size()));
  }

 private:
  std::size_t shift(std::size_t k, std::size_t count) const { return 8 * (big_ ? count - 1 - k : k); }
  bool big_;
};

std::vector<Entry> read_directory(std::span<const std::uint8_t> file, std::size_t at, const Order& order) {
  std::vector<Entry> entries;
  if (at < 8 || at > file.size() || file.size() - at < 2) return entries;
  const std::size_t count = std::min<std::size_t>(order.read(file.subspan(at, 2)), kMaxExifEntries);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t from = at + 2 + k * kEntryBytes;
    if (from + kEntryBytes > file.size()) break;
    Entry entry;
    entry.tag = static_cast<std::uint16_t>(order.read(file.subspan(from, 2)));
    entry.type = static_cast<std::uint16_t>(order.read(file.subspan(from + 2, 2)));
    entry.count = order.read(file.subspan(from + 4, 4));
    const std::size_t each = entry.type < kTypeBytes.size() ? kTypeBytes[entry.type] : 0;
    if (each == 0 || entry.count == 0 || entry.count > kMaxExifEntryBytes / each) continue;
    const std::size_t bytes = each * entry.count;
    const std::size_t place = bytes <= 4 ? from + 8 : order.read(file.subspan(from + 8, 4));
    if (place > file.size() || file.size() - place < bytes) continue;
    const auto value = file.subspan(place, bytes);
    entry.value.assign(value.begin(), value.end());
    entries.push_back(std::move(entry));
  }
  return entries;
}

/// Appends a directory and the values that do not fit into it; returns its offset.
std::uint32_t append_directory(std::vector<std::uint8_t>& block, const std::vector<Entry>& entries,
                               const Order& order) {
  const std::size_t begin = block.size();
  block.resize(begin + 2 + kEntryBytes * entries.size() + 4);
  order.write(static_cast<std::uint32_t>(entries.size()), std::span(block).subspan(begin, 2));
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const Entry& entry = entries[k];
    const std::size_t at = begin + 2 + k * kEntryBytes;
    order.write(entry.tag, std::span(block).subspan(at, 2));
    order.write(entry.type, std::span(block).subspan(at + 2, 2));
    order.write(entry.count, std::span(block).subspan(at + 4, 4));
    if (entry.value.size() <= 4) {
      std::ranges::copy(entry.value, block.begin() + static_cast<std::ptrdiff_t>(at + 8));
      continue;
    }
    order.write(static_cast<std::uint32_t>(block.size()), std::span(block).subspan(at + 8, 4));
    block.insert(block.end(), entry.value.begin(), entry.value.end());
    if (block.size() % 2 == 1) block.push_back(0);
  }
  return static_cast<std::uint32_t>(begin);
}

}  // namespace

std::vector<std::uint8_t> exif_block(std::span<const std::uint8_t> file) {
  if (file.size() < 8) return {};
  const Order order(file[0] == 'M');
  if (order.read(file.subspan(2, 2)) != 42) return {};
  std::vector<Entry> first;
  std::vector<std::uint8_t> block(file.begin(), file.begin() + 8);
  for (const Entry& entry : read_directory(file, order.read(file.subspan(4, 4)), order)) {
    if (entry.tag == kMake || entry.tag == kModel || entry.tag == kDateTime) first.push_back(entry);
    if ((entry.tag != kExifDirectory && entry.tag != kGpsDirectory) || entry.value.size() != 4) continue;
    std::vector<Entry> inside = read_directory(file, order.read(entry.value), order);
    std::erase_if(inside, [](const Entry& e) { return e.tag == kMakerNote || e.tag == kInterop; });
    if (inside.empty()) continue;
    Entry link{entry.tag, kLong, 1, std::vector<std::uint8_t>(4)};
    order.write(append_directory(block, inside, order), link.value);
    first.push_back(std::move(link));
  }
  const bool useful = std::ranges::any_of(first, [](const Entry& e) { return e.tag != kMake && e.tag != kModel; });
  if (!useful) return {};
  const std::uint32_t at = append_directory(block, first, order);
  order.write(at, std::span(block).subspan(4, 4));
  return block;
}

}  // namespace nodal::media
