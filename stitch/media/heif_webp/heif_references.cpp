#include "stitch/media/heif_webp/heif_references.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

namespace nodal::media {
namespace {

using Bytes = std::span<const std::uint8_t>;
using References = std::map<std::uint64_t, std::vector<std::uint64_t>>;  ///< the items that an item is made of

/// Takes numbers from the front, the highest byte first.
class Cursor {
 public:
  explicit Cursor(Bytes bytes) : bytes_(bytes) {}

  std::optional<std::uint64_t> number(std::size_t width) {
    if (bytes_.size() < width) return std::nullopt;
    std::uint64_t value = 0;
    for (const std::uint8_t byte : bytes_.first(width)) value = value << 8 | byte;
    bytes_ = bytes_.subspan(width);
    return value;
  }
  Bytes rest() const { return bytes_; }

 private:
  Bytes bytes_;
};

/// A box of ISO/IEC 14496-12, 4.2.
struct Box {
  std::string_view type;
  Bytes content;
};

/// Takes a box from the front; nothing at the end. As for libheif, a box that is too long ends with what contains it.
std::optional<Box> next_box(Bytes& bytes) {
  Cursor cursor(bytes);
  auto size = cursor.number(4);
  if (!size || cursor.rest().size() < 4) return std::nullopt;
  const std::string_view type(reinterpret_cast<const char*>(cursor.rest().data()), 4);
  (void)cursor.number(4);
  if (*size == 1) size = cursor.number(8);
  if (size && *size == 0) size = bytes.size();
  const std::size_t header = bytes.size() - cursor.rest().size();
  if (!size || *size < header) return std::nullopt;
  size = std::min<std::uint64_t>(*size, bytes.size());
  const Box box{type, bytes.subspan(header, *size - header)};
  bytes = bytes.subspan(*size);
  return box;
}

/// Adds a reference of an `iref` box; returns what follows it. libheif 1.15 reads a reference to its end whatever
/// length its box has, and zeros behind the end.
Bytes add_reference(const Box& box, Bytes rest, std::size_t width, References& references) {
  Cursor cursor(rest);
  const auto from = cursor.number(width);
  const auto count = cursor.number(2);
  for (std::uint64_t k = 0; from && count && k < *count; ++k) {
    const auto field = cursor.number(width);
    const std::uint64_t to = field.value_or(0);
    if (box.type == "dimg") references[*from].push_back(to);
    if (box.type == "auxl") references[to].push_back(*from);
    if (!field) break;
  }
  return cursor.rest();
}

/// The references of an `iref` box (8.11.12). `by_length`: the next one is where the box of the one before ends, as the
/// standard says; else where its last number ends, as libheif 1.15 reads.
void add_references(Bytes content, bool by_length, References& references) {
  Cursor full(content);
  const auto version = full.number(4);
  if (!version) return;
  const std::size_t width = *version >> 24 == 0 ? 2 : 4;
  Bytes boxes = full.rest();
  while (true) {
    Bytes after = boxes;
    const auto box = next_box(after);
    if (!box) return;
    const Bytes rest = boxes.subspan(static_cast<std::size_t>(box->content.data() - boxes.data()));
    const Bytes read = add_reference(*box, rest, width, references);
    boxes = by_length ? after : read;
  }
}

/// Counts an item and all that it is made of; false as soon as a limit is passed.
bool count_items(const References& references, std::uint64_t item, int depth, int& items) {
  if (depth > kMaxHeifDepth || ++items > kMaxHeifPictures) return false;
  const auto found = references.find(item);
  if (found == references.end()) return true;
  for (const std::uint64_t part : found->second) {
    if (!count_items(references, part, depth + 1, items)) return false;
  }
  return true;
}

}  // namespace

bool are_references_bounded(std::span<const std::uint8_t> file) {
  std::array<References, 2> ways;
  while (const auto box = next_box(file)) {
    if (box->type != "meta") continue;
    Cursor full(box->content);
    if (!full.number(4)) continue;  // version and flags
    Bytes boxes = full.rest();
    while (const auto inner = next_box(boxes)) {
      if (inner->type != "iref") continue;
      add_references(inner->content, true, ways[0]);
      add_references(inner->content, false, ways[1]);
    }
  }
  for (const References& references : ways) {
    int items = 0;
    for (const auto& [item, parts] : references) {
      if (!count_items(references, item, 1, items)) return false;
    }
  }
  return true;
}

}  // namespace nodal::media
