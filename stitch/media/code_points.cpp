#include "stitch/media/code_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

namespace nodal::media {
namespace {

struct NamedPrimaries {
  std::uint8_t code;
  std::array<double, 8> xy;  ///< chromaticities of white, red, green, blue (H.273, table 2)
};
constexpr std::array kCodedPrimaries{NamedPrimaries{4, {0.310, 0.316, 0.67, 0.33, 0.21, 0.71, 0.14, 0.08}},
                                     NamedPrimaries{5, {0.3127, 0.3290, 0.64, 0.33, 0.29, 0.60, 0.15, 0.06}},
                                     NamedPrimaries{6, {0.3127, 0.3290, 0.630, 0.340, 0.310, 0.595, 0.155, 0.070}},
                                     NamedPrimaries{7, {0.3127, 0.3290, 0.630, 0.340, 0.310, 0.595, 0.155, 0.070}},
                                     NamedPrimaries{9, {0.3127, 0.3290, 0.708, 0.292, 0.170, 0.797, 0.131, 0.046}},
                                     NamedPrimaries{11, {0.314, 0.351, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060}},
                                     NamedPrimaries{12, {0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060}},
                                     NamedPrimaries{22, {0.3127, 0.3290, 0.630, 0.340, 0.295, 0.605, 0.155, 0.077}}};
constexpr std::uint8_t kBt709 = 1, kUnspecified = 2;

/// H.273, table 3.
void set_transfer(std::uint8_t code, SampleMeaning& meaning) {
  using Curve = SampleMeaning::Curve;
  switch (code) {
    case 1:
    case kUnspecified:
    case 6:
    case 14:
    case 15: meaning.curve = Curve::kUnsaid; return;
    case 4: meaning.curve = Curve::kGamma, meaning.gamma = 2.2; return;
    case 5: meaning.curve = Curve::kGamma, meaning.gamma = 2.8; return;
    case 8: meaning.curve = Curve::kGamma, meaning.gamma = 1; return;
    case 13: meaning.curve = Curve::kSrgb; return;
    case 16: meaning.unread = "PQ (HDR)"; return;
    case 18: meaning.unread = "HLG (HDR)"; return;
    default: meaning.unread = fmt::format("the transfer characteristics {} of H.273", code); return;
  }
}

}  // namespace

void set_code_points(std::span<const std::uint8_t, 4> points, SampleMeaning& meaning) {
  meaning.icc.clear();
  meaning.primaries.reset();
  set_transfer(points[1], meaning);
  const auto named = std::ranges::find(kCodedPrimaries, points[0], &NamedPrimaries::code);
  if (named != kCodedPrimaries.end()) {
    meaning.primaries = named->xy;
  } else if (points[0] != kBt709 && points[0] != kUnspecified) {
    meaning.unread = fmt::format("the colour primaries {} of H.273", points[0]);
  }
  if (points[2] != 0) meaning.unread = fmt::format("the matrix {} of H.273", points[2]);
  if (points[3] != 1) meaning.unread = "video's narrow range";
}

}  // namespace nodal::media
