#include "stitch/media/tiff/colorimetry.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "stitch/media/known_curve.h"

namespace nodal::media {
namespace {

/// The curve of all channels; nothing if they differ or if it is none that has a name.
std::optional<SampleMeaning> curve_of(const std::array<std::uint16_t*, 3>& tables, std::size_t entries) {
  const std::span<const std::uint16_t> first(tables[0], entries);
  const bool same = std::ranges::all_of(tables, [&](const std::uint16_t* table) {
    return table == nullptr || std::equal(first.begin(), first.end(), table);
  });
  return same ? known_curve(first) : std::nullopt;
}

}  // namespace

void read_colorimetry(TIFF* tiff, SampleMeaning& meaning) {
  std::uint16_t bits = 1, light = PHOTOMETRIC_RGB;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &light);
  std::array<std::uint16_t*, 3> tables{};
  if (TIFFGetField(tiff, TIFFTAG_TRANSFERFUNCTION, &tables[0], &tables[1], &tables[2]) == 1 && tables[0] != nullptr) {
    const bool plain = (light == PHOTOMETRIC_RGB || light == PHOTOMETRIC_MINISBLACK) && bits <= 16;
    if (const auto known = plain ? curve_of(tables, std::size_t{1} << bits) : std::nullopt) {
      meaning.curve = known->curve;
      meaning.gamma = known->gamma;
    } else {
      meaning.unread = "its TransferFunction";
    }
  }
  const float* colours = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_PRIMARYCHROMATICITIES, &colours) != 1 || colours == nullptr) return;
  std::array<double, 8> xy{0.3127, 0.3290};  // the default of white, D65
  const float* white = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_WHITEPOINT, &white) == 1 && white != nullptr) std::copy_n(white, 2, xy.begin());
  std::copy_n(colours, 6, xy.begin() + 2);
  if (!is_srgb_primaries(xy)) meaning.primaries = xy;
}

}  // namespace nodal::media
