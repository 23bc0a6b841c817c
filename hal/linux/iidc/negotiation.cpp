#include "hal/linux/iidc/negotiation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

/// Two rates are the same if they differ by less; 30 and 30000/1001 differ by 0.001.
constexpr double kSameRate = 0.0005;

double hertz(FrameRate rate) { return static_cast<double>(rate.numerator) / rate.denominator; }

std::string text_of(FrameRate rate) {
  std::string text = std::to_string(rate.numerator);
  return rate.denominator == 1 ? text : fmt::format("{}/{}", text, rate.denominator);
}

std::string size_text(int width, int height) { return fmt::format("{}x{}", width, height); }

/// The rate at which the mode runs for this request; nothing if it has none that fits.
std::optional<FrameRate> rate_in(const Mode& mode, const HeadRequest& request) {
  const double wanted = hertz(request.rate);
  for (const FrameRate rate : mode.rates) {
    if (std::abs(hertz(rate) / wanted - 1) < kSameRate) return rate;
    if (request.triggered && hertz(rate) > wanted) return rate;
  }
  return std::nullopt;
}

std::string list_of(const std::set<std::string>& all) {
  std::string text;
  for (const std::string& one : all) text += (text.empty() ? "" : ", ") + one;
  return text.empty() ? "none" : text;
}

class Negotiation {
 public:
  Negotiation(Camera& camera, const std::string& head, const HeadRequest& request, std::vector<Mode> modes)
      : camera_(camera), head_(head), request_(request), modes_(std::move(modes)) {}

  Result<Selection> choose() {
    NODAL_TRY(has_format());
    if (const auto fixed = choose_fixed()) return *fixed;
    return choose_scalable();
  }

 private:
  Error refused(const std::string& sentence) const { return {Errc::kUnsupported, "head '" + head_ + "': " + sentence}; }

  Status has_format() {
    std::set<std::string> formats;
    for (const Mode& mode : modes_) formats.insert(std::string(pixel_format_name(mode.pixels)));
    std::erase_if(modes_, [&](const Mode& mode) { return mode.pixels != request_.pixels; });
    if (!modes_.empty()) return {};
    return fail(refused("the camera has no format " + std::string(pixel_format_name(request_.pixels)) +
                        "; it has: " + list_of(formats)));
  }

  std::optional<Selection> choose_fixed() const {
    if (request_.left || request_.packet_bytes > 0) return std::nullopt;
    std::optional<Selection> best;
    for (const Mode& mode : modes_) {
      if (mode.scalable || (request_.width > 0 && (mode.width != request_.width || mode.height != request_.height))) {
        continue;
      }
      const auto rate = rate_in(mode, request_);
      if (rate && (!best || mode.width > best->width)) best = Selection{mode, *rate, mode.width, mode.height, 0, 0, 0};
    }
    return best;
  }

  Result<Selection> choose_scalable() const {
    std::string why;
    for (const Mode& mode : modes_) {
      if (!mode.scalable) continue;
      Selection selection{mode, request_.rate, request_.width, request_.height, 0, 0, request_.packet_bytes};
      if (request_.width == 0) {
        selection.width = mode.width;
        selection.height = mode.height;
      }
      // The middle of the sensor, unless a place is requested.
      selection.left = request_.left.value_or((mode.width - selection.width) / 2 / mode.left_unit * mode.left_unit);
      selection.top = request_.top.value_or((mode.height - selection.height) / 2 / mode.top_unit * mode.top_unit);
      why = misfit(mode, selection);
      if (why.empty()) return selection;
    }
    if (!why.empty()) return fail(refused(why));
    return fail(refused("the camera has no " + std::string(pixel_format_name(request_.pixels)) +
                        (request_.width > 0 ? " of " + size_text(request_.width, request_.height) : "") + " at " +
                        text_of(request_.rate) + " frames a second; it has: " + list_of(fixed_modes())));
  }

  static std::string misfit(const Mode& mode, const Selection& s) {
    if (s.width % mode.width_unit != 0 || s.height % mode.height_unit != 0) {
      return "its sizes are multiples of " + size_text(mode.width_unit, mode.height_unit) + ", and " +
             size_text(s.width, s.height) + " is not";
    }
    if (s.left % mode.left_unit != 0 || s.top % mode.top_unit != 0) {
      return fmt::format("its offsets are multiples of {} and {}, and {}, {} are not", mode.left_unit, mode.top_unit,
                         s.left, s.top);
    }
    if (s.left < 0 || s.top < 0 || s.left + s.width > mode.width || s.top + s.height > mode.height) {
      return fmt::format("{} at {}, {} is not inside its {} px", size_text(s.width, s.height), s.left, s.top,
                         size_text(mode.width, mode.height));
    }
    return {};
  }

  std::set<std::string> fixed_modes() const {
    std::set<std::string> all;
    for (const Mode& mode : modes_) {
      std::string rates;
      for (const FrameRate rate : mode.rates) rates += (rates.empty() ? "" : " ") + text_of(rate);
      all.insert(size_text(mode.width, mode.height) + (mode.scalable ? " and smaller" : " at " + rates));
    }
    return all;
  }

  Camera& camera_;
  const std::string& head_;
  const HeadRequest& request_;
  std::vector<Mode> modes_;
};

/// Where the rate is the camera's own setting, it is set; elsewhere the mode determines it.
Status set_rate(Camera& camera, FrameRate rate) {
  NODAL_TRY_ASSIGN(const auto feature, camera.feature(FeatureId::kFrameRate));
  if (!feature.present || !feature.absolute) return {};
  NODAL_TRY(camera.set_manual(FeatureId::kFrameRate));
  return camera.set_absolute(FeatureId::kFrameRate, static_cast<float>(hertz(rate)));
}

/// The rate in free run, with the one that was set.
Result<double> own_rate(Camera& camera, const Selected& selected) {
  NODAL_TRY_ASSIGN(const auto feature, camera.feature(FeatureId::kFrameRate));
  if (!feature.present || !feature.absolute) return selected.hertz;
  return std::min(selected.hertz, static_cast<double>(feature.absolute_value));
}

}  // namespace

Result<Granted> negotiate(Camera& camera, const std::string& head, const HeadRequest& request) {
  NODAL_TRY_ASSIGN(auto modes, camera.modes());
  NODAL_TRY_ASSIGN(const auto selection, Negotiation(camera, head, request, std::move(modes)).choose());
  NODAL_TRY_ASSIGN(const auto selected, camera.select(selection));
  // Also of a head that will be triggered: it runs free until then.
  NODAL_TRY(set_rate(camera, request.rate));
  NODAL_TRY_ASSIGN(const auto rate, own_rate(camera, selected));
  if (!request.triggered && std::abs(rate / hertz(request.rate) - 1) >= kSameRate) {
    return fail(Errc::kUnsupported, fmt::format("head '{}': the camera delivers {:f} frames a second, and the rig's "
                                                "rate is {}; choose another size, packet_bytes or rate",
                                                head, rate, text_of(request.rate)));
  }
  Granted granted;
  granted.format = {request.pixels, selection.width, selection.height, Fields::kProgressive, request.rate};
  granted.frame_bytes = selected.frame_bytes;
  granted.picture_bytes = packed_size(request.pixels, selection.width, selection.height);
  if (granted.frame_bytes < granted.picture_bytes || granted.frame_bytes > (std::size_t{1} << 30)) {
    return fail(Errc::kDeviceFailed,
                fmt::format("head '{}': the camera's frames have {} bytes, and a picture of {} is {}", head,
                            granted.frame_bytes, size_text(selection.width, selection.height), granted.picture_bytes));
  }
  return granted;
}

}  // namespace nodal::hal::iidc
