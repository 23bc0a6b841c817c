#include "stitch/geometry/raymap/ray_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "protocol/base/sha256.h"
#include "protocol/base/try.h"

namespace nodal::geometry {
namespace {

std::string of_line(int line) { return fmt::format("line {}: ", line); }

/// Reads numbers that blanks separate, and nothing else. False if there are others than `count`.
template <class Number>
bool read_numbers(std::string_view text, Number* into, int count) {
  const char *at = text.data(), *end = text.data() + text.size();
  for (int k = 0; k <= count; ++k) {
    while (at != end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    if (k == count) return at == end;
    const auto [after, error] = std::from_chars(at, end, into[k]);
    if (error != std::errc() || after == at) return false;
    at = after;
  }
  return false;
}

Result<RaymapSize> read_size(std::string_view text, int line) {
  constexpr std::string_view kBegin = "rays ";
  int sides[2] = {0, 0};
  if (!text.starts_with(kBegin) || !read_numbers(text.substr(kBegin.size()), sides, 2)) {
    return fail(Errc::kBadFormat, of_line(line) + "the first line must be: rays WIDTH HEIGHT; this is no list of rays");
  }
  const auto good = [](int side) { return side >= 2 && side <= kMaxRaymapSide && side % 2 == 0; };
  if (!good(sides[0]) || !good(sides[1])) {
    return fail(Errc::kBadValue,
                fmt::format("{}width and height must be even, 2 to {}", of_line(line), kMaxRaymapSide));
  }
  if (static_cast<std::size_t>(sides[0]) * static_cast<std::size_t>(sides[1]) > kMaxRays)
    return fail(Errc::kTooLarge, fmt::format("{}a list has at most {} rays", of_line(line), kMaxRays));
  return RaymapSize{sides[0], sides[1]};
}

/// Two rays that are the same, to 1e-12, are beside each other in the order of their first coordinates but for others
/// with nearly that coordinate.
Status check_different(const RayList& list, const std::vector<int>& lines) {
  constexpr double kSame = 1e-12;
  std::vector<std::uint32_t> order(list.rays.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::uint32_t k) { return std::pair(list.rays[k], k); });
  for (std::size_t k = 1; k < order.size(); ++k) {
    const std::array<double, 3>&a = list.rays[order[k - 1]], &b = list.rays[order[k]];
    double apart = 0;
    for (std::size_t c = 0; c < 3; ++c) apart = std::max(apart, std::abs(a[c] - b[c]));
    if (apart > kSame) continue;
    const auto [first, second] = std::minmax(lines[order[k - 1]], lines[order[k]]);
    return fail(Errc::kBadValue, fmt::format("{}the ray is the same as that of line {}", of_line(second), first));
  }
  return {};
}

struct Known {
  std::uint64_t digits;
  RayList list;
};

/// The known lists, in the order in which they became known. None is removed, because any name that was given out may
/// be used at any time.
std::array<std::atomic<const Known*>, kMaxRayLists>& all_known() {
  static std::array<std::atomic<const Known*>, kMaxRayLists> slots{};
  return slots;
}

}  // namespace

Result<RayList> parse_ray_list(std::string_view text) {
  if (text.size() > kMaxRayFileBytes) {
    return fail(Errc::kTooLarge,
                fmt::format("a list of rays has at most {} bytes: give fewer digits or rays", kMaxRayFileBytes));
  }
  RayList list;
  std::vector<int> lines;
  std::size_t count = 0;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view content = text.substr(0, end);
    content = content.substr(0, content.find('#'));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (content.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    if (count == 0) {
      NODAL_TRY_ASSIGN(const RaymapSize size, read_size(content, line));
      list.size = size;
      count = static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
      continue;
    }
    if (list.rays.size() == count) {
      return fail(Errc::kBadFormat,
                  fmt::format("{}there are more than the {} rays that the first line says", of_line(line), count));
    }
    std::array<double, 3> ray{};
    if (!read_numbers(content, ray.data(), 3))
      return fail(Errc::kBadFormat, of_line(line) + "a ray is three numbers, X Y Z");
    const double length = std::hypot(ray[0], ray[1], ray[2]);
    if (!(length >= 1e-100 && length <= 1e100))
      return fail(Errc::kBadValue, of_line(line) + "the ray is no direction: its length must be 1e-100 to 1e100");
    for (double& coordinate : ray) coordinate /= length;
    list.rays.push_back(ray);
    lines.push_back(line);
  }
  if (count == 0) return fail(Errc::kBadFormat, "there is no line: rays WIDTH HEIGHT; this is no list of rays");
  if (list.rays.size() < count) {
    return fail(Errc::kTruncated,
                fmt::format("there are {} rays, and the first line says {}", list.rays.size(), count));
  }
  NODAL_TRY(check_different(list, lines));
  return list;
}

Result<std::string> make_ray_list_known(std::string_view text) {
  NODAL_TRY_ASSIGN(RayList list, parse_ray_list(text));
  const Sha256 digest = sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  std::uint64_t digits = 0;
  for (std::size_t k = 0; k < 8; ++k) digits = digits << 8 | digest[k];
  auto made = std::make_unique<const Known>(Known{digits, std::move(list)});
  for (std::atomic<const Known*>& slot : all_known()) {
    const Known* present = nullptr;
    if (slot.compare_exchange_strong(present, made.get())) present = made.release();
    if (present->digits == digits) return "rays:" + to_hex(digest).substr(0, 16);
  }
  return fail(Errc::kTooLarge, fmt::format("at most {} lists of rays are used at once", kMaxRayLists));
}

const RayList* known_ray_list(std::uint64_t digits) {
  for (const std::atomic<const Known*>& slot : all_known()) {
    const Known* known = slot.load();
    if (known == nullptr) return nullptr;
    if (known->digits == digits) return &known->list;
  }
  return nullptr;
}

}  // namespace nodal::geometry
