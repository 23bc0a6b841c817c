// The names, sizes and parameters of all raymap layouts. Free of Eigen, so that the configuration can include it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"

namespace nodal::geometry {

class RaymapLayout;

inline constexpr int kMaxRaymapSide = 32768;

/// The width and height of a raymap in pixels.
struct RaymapSize {
  int width = 0;
  int height = 0;
};

/// A whole number that may follow a layout's name: "cube:pad=4".
struct LayoutParameter {
  std::string_view key;  ///< empty: the layout has none
  std::int64_t least = 0;
  std::int64_t most = 0;
  std::int64_t otherwise = 0;  ///< its value when the name does not give it
};

struct LayoutKind {
  std::string_view name;
  std::string_view what;  ///< one line for users
  Result<std::unique_ptr<RaymapLayout>> (*make)(RaymapSize size, std::int64_t value);
  double radians_across;  ///< the width divided by pixels per radian, where pixels are largest
  RaymapSize step;        ///< the smallest size with subsampled chroma; sizes are multiples of it
  /// Height divided by width where pixels are about square. Null if the layout has the ratio of `step` only; otherwise
  /// both sides may be any multiples of `step`'s.
  double (*ratio)(std::int64_t value) = nullptr;
  LayoutParameter parameter = {};
  /// The only size, of a list of rays; nothing if the list is not known. Null for layouts that have many.
  std::optional<RaymapSize> (*only_size)(std::int64_t value) = nullptr;
};

/// Every layout, in the order of lists for users, but for lists of rays, which have no size of their own choice.
std::span<const LayoutKind> layout_kinds();

/// The layouts' names, separated by commas.
std::string layout_list();

/// A layout with the value of its parameter; as text "cube", "cube:pad=4", or "rays:HASH" for a list of rays that is
/// known to this process.
class LayoutName {
 public:
  /// Errors: kUnsupported for an unknown name (the message lists the known ones); kBadValue for a parameter that the
  /// layout does not have, or whose value is out of range; kNotFound for a list of rays that is not known here.
  static Result<LayoutName> parse(std::string_view text);
  /// The same, and "rays:FILE": makes the list of this file known. Errors: also those of `read` and
  /// make_ray_list_known().
  static Result<LayoutName> parse(std::string_view text, const ReadRayFile& read);

  const LayoutKind& kind() const { return *kind_; }
  std::int64_t value() const { return value_; }
  /// The canonical text: without a parameter that has its usual value.
  std::string text() const;
  /// Whether players know it as a sphere (GPano).
  bool is_equirectangular() const { return kind_ == layout_kinds().data(); }
  bool is_ray_list() const { return kind_->only_size != nullptr; }

  /// The width, rarely a whole number, at which a whole-sphere raymap has `pixels_per_radian` where its pixels are
  /// largest (equirectangular: at the equator; cube: in the centre of a face).
  double width_for_resolution(double pixels_per_radian) const;
  /// The smallest size of a raymap with at least this width, up to kMaxRaymapSide, with about square pixels; valid for
  /// halved chroma. Of a list of rays: its size.
  RaymapSize size_for_width(double width) const;
  /// Refuses sizes that have no halved chroma or strongly stretched pixels. The message completes "WIDTHxHEIGHT ...".
  /// Errors: kBadValue.
  Status check_size(RaymapSize size) const;

 private:
  LayoutName(const LayoutKind& kind, std::int64_t value) : kind_(&kind), value_(value) {}

  const LayoutKind* kind_;
  std::int64_t value_;
};

}  // namespace nodal::geometry
