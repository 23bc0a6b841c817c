#include "stitch/media/tiff/exif_block.h"

#include <algorithm>
#include <array>
#include <optional>

namespace nodal::media {
namespace {

constexpr std::uint16_t kMake = 271, kModel = 272, kDateTime = 306, kExifDirectory = 34665, kGpsDirectory = 34853;
constexpr std::uint16_t kMakerNote = 37500, kInterop = 40965;  ///< with offsets of their own
constexpr std::uint16_t kLong = 4, kRational = 5, kSignedRational = 10;
/// Bytes of a value by its type (TIFF 6.0, section 2; the last: an offset, of TIFF Technical Note 1).
constexpr std::array<std::size_t, 14> kTypeBytes{0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4};
constexpr std::size_t kEntryBytes = 12;

struct Entry {
  std::uint16_t tag = 0, type = 0;
  std::uint32_t count = 0;
  std::vector<std::uint8_t> value{};  ///< bytes as they are in the file
};

/// Numbers of a file's byte order.
class Order {
 public:
  explicit Order(bool big_endian) : big_(big_endian) {}
  explicit Order(std::span<const std::uint8_t> file) : big_(file[0] == 'M') {}
  bool operator==(const Order&) const = default;
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

/// A directory's entries as they stand in it: an offset in place of a long value.
std::vector<Entry> read_entries(std::span<const std::uint8_t> file, std::size_t at, const Order& order) {
  std::vector<Entry> entries;
  const std::size_t count = order.read(file.subspan(at, 2));
  for (std::size_t k = 0; k < count; ++k) {
    const auto entry = file.subspan(at + 2 + k * kEntryBytes, kEntryBytes);
    entries.push_back({static_cast<std::uint16_t>(order.read(entry.first(2))),
                       static_cast<std::uint16_t>(order.read(entry.subspan(2, 2))),
                       order.read(entry.subspan(4, 4)),
                       {entry.begin() + 8, entry.end()}});
  }
  return entries;
}

Entry in_order(Entry entry, const Order& from, const Order& to) {
  if (from == to) return entry;
  const bool pairs = entry.type == kRational || entry.type == kSignedRational;
  const std::size_t each = kTypeBytes[entry.type] / (pairs ? 2 : 1);
  for (std::size_t k = 0; k < entry.value.size(); k += each) {
    std::ranges::reverse(std::span(entry.value).subspan(k, each));
  }
  return entry;
}

Entry link_to(std::uint16_t tag, std::uint32_t offset, const Order& order) {
  Entry link{tag, kLong, 1, std::vector<std::uint8_t>(4)};
  order.write(offset, link.value);
  return link;
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
  const Order order(file);
  if (order.read(file.subspan(2, 2)) != 42) return {};
  std::vector<Entry> first;
  std::vector<std::uint8_t> block(file.begin(), file.begin() + 8);
  for (const Entry& entry : read_directory(file, order.read(file.subspan(4, 4)), order)) {
    if (entry.tag == kMake || entry.tag == kModel || entry.tag == kDateTime) first.push_back(entry);
    if ((entry.tag != kExifDirectory && entry.tag != kGpsDirectory) || entry.value.size() != 4) continue;
    std::vector<Entry> inside = read_directory(file, order.read(entry.value), order);
    std::erase_if(inside, [](const Entry& e) { return e.tag == kMakerNote || e.tag == kInterop; });
    if (inside.empty()) continue;
    first.push_back(link_to(entry.tag, append_directory(block, inside, order), order));
  }
  const bool useful = std::ranges::any_of(first, [](const Entry& e) { return e.tag != kMake && e.tag != kModel; });
  if (!useful) return {};
  const std::uint32_t at = append_directory(block, first, order);
  order.write(at, std::span(block).subspan(4, 4));
  return block;
}

void add_exif(std::vector<std::uint8_t>& file, std::span<const std::uint8_t> block) {
  if (block.size() < 8) return;
  const Order order(file), from(block);
  std::vector<Entry> first = read_entries(file, order.read(std::span(file).subspan(4, 4)), order);
  if (file.size() % 2 == 1) file.push_back(0);
  for (const Entry& entry : read_directory(block, from.read(block.subspan(4, 4)), from)) {
    const bool linked = entry.tag == kExifDirectory || entry.tag == kGpsDirectory;
    const bool text = entry.tag == kMake || entry.tag == kModel || entry.tag == kDateTime;
    if ((!linked && !text) || std::ranges::find(first, entry.tag, &Entry::tag) != first.end()) continue;
    if (text) {
      first.push_back(in_order(entry, from, order));
      continue;
    }
    if (entry.value.size() != 4) continue;
    std::vector<Entry> inside = read_directory(block, from.read(entry.value), from);
    std::erase_if(inside, [](const Entry& e) { return e.tag == kMakerNote || e.tag == kInterop; });
    for (Entry& e : inside) e = in_order(std::move(e), from, order);
    std::ranges::stable_sort(inside, {}, &Entry::tag);
    if (!inside.empty()) first.push_back(link_to(entry.tag, append_directory(file, inside, order), order));
  }
  std::ranges::stable_sort(first, {}, &Entry::tag);
  const std::uint32_t at = append_directory(file, first, order);
  order.write(at, std::span(file).subspan(4, 4));
}

}  // namespace nodal::media
