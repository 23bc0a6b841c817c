// A chart of colours in several colour spaces, as every kind of picture file.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "rig_process.h"

namespace nodal::command_line {

using Bytes = std::vector<std::uint8_t>;

/// A colour space by its numbers: white, red, green, blue; gamma 0 is sRGB's curve.
struct Space {
  const char* name;
  std::array<double, 8> xy;
  double gamma;
};
inline constexpr Space kAdobeRgb{"AdobeRGB", {0.3127, 0.3290, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06}, 563.0 / 256};
inline constexpr Space kDisplayP3{"DisplayP3", {0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060}, 0};
inline constexpr Space kSrgbSpace{"sRGB", {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06}, 0};
inline constexpr Space kLinear{"linear", kSrgbSpace.xy, 1};
inline constexpr Space kGrey22{"grey2.2", kSrgbSpace.xy, 2.2};

/// Its ICC profile by Little CMS; `grey`: one for pictures of one channel.
Bytes icc_of(const Space& space, bool grey = false);

/// Samples of 0 to 1 of red, green and blue in another space with the same white: by the definition of both, without
/// Little CMS. Colours outside the other space are moved to its edge.
std::vector<double> by_definition(const std::vector<double>& rgb, const Space& from, const Space& to);

/// The k-th of kColours colours: all of dark, middle and bright red, green and blue, and greys between them.
inline constexpr int kColours = 32;
std::array<std::uint8_t, 3> chart_colour(int k);

/// The chart on a sphere: patches of kPatch pixels, RGB, 8 bits.
inline constexpr int kWide = 64, kHigh = 32, kPatch = 8;
Bytes chart();
std::vector<double> levels_of(const Bytes& bytes);

/// A PNG with another chunk behind its header.
Bytes with_chunk(Bytes png, const std::string& name, const Bytes& data);
Bytes with_profile(const Bytes& png, const Bytes& icc);
/// A JPEG with a profile of less than 64 KiB.
Bytes jpeg_with_profile(Bytes jpeg, const Bytes& icc);
/// The same levels with 16 bits, big-endian.
Bytes deep_of(const Bytes& samples);

struct TiffForm {
  int width = kWide, height = kHigh, channels = 3, bits = 8;
  int alpha = -1;  ///< EXTRASAMPLE_...; -1: none
};
void write_tiff(const std::string& file, Bytes samples, const TiffForm& form, const Bytes& icc = {});

class ColourCommand : public RigTest {
 protected:
  /// The sphere's chart in a space as every kind of file; their names.
  std::vector<std::string> write_chart(const Space& space) const;
  /// Samples, 0 to 1, of a picture that Nodal wrote, red, green and blue.
  std::vector<double> samples(const std::string& name) const;
  void run(const Words& words) const;
  /// Largest error in the middles of the sphere's patches, where no coding or interpolation mixes two of them.
  static double largest_error(const std::vector<double>& got, const std::vector<double>& right);
};

}  // namespace nodal::command_line
