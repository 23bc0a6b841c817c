#include "colour_chart.h"

#include <gtest/gtest.h>
#include <lcms2.h>
#include <tiffio.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>

#include "stitch/media/image_file.h"
#include "stitch/media/tiff/tiff_reader.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;

double determinant(const Matrix& m) {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/// x of m x = b, by Cramer's rule.
std::array<double, 3> solved(const Matrix& m, const std::array<double, 3>& b) {
  std::array<double, 3> x{};
  for (std::size_t k = 0; k < 3; ++k) {
    Matrix replaced = m;
    for (std::size_t row = 0; row < 3; ++row) replaced[row][k] = b[row];
    x[k] = determinant(replaced) / determinant(m);
  }
  return x;
}

std::array<double, 3> xyz(double x, double y) { return {x / y, 1, (1 - x - y) / y}; }

/// From the light of red, green and blue to X, Y and Z: columns are the primaries, scaled so that their sum is white.
Matrix to_xyz(const Space& space) {
  Matrix m{};
  for (std::size_t c = 0; c < 3; ++c) {
    const std::array<double, 3> column = xyz(space.xy[2 + 2 * c], space.xy[3 + 2 * c]);
    for (std::size_t row = 0; row < 3; ++row) m[row][c] = column[row];
  }
  const std::array<double, 3> scale = solved(m, xyz(space.xy[0], space.xy[1]));
  for (auto& row : m) {
    for (std::size_t c = 0; c < 3; ++c) row[c] *= scale[c];
  }
  return m;
}

double light_of(const Space& space, double level) {
  if (space.gamma != 0) return std::pow(level, space.gamma);
  return level <= 0.04045 ? level / 12.92 : std::pow((level + 0.055) / 1.055, 2.4);  // IEC 61966-2-1
}

double level_of(const Space& space, double light) {
  light = std::clamp(light, 0.0, 1.0);
  if (space.gamma != 0) return std::pow(light, 1 / space.gamma);
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

cmsHPROFILE profile_of(const Space& space, bool grey) {
  const cmsCIExyY white{space.xy[0], space.xy[1], 1};
  const cmsCIExyYTRIPLE corners{
      {space.xy[2], space.xy[3], 1}, {space.xy[4], space.xy[5], 1}, {space.xy[6], space.xy[7], 1}};
  const std::array<double, 5> srgb{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  cmsToneCurve* const curve =
      space.gamma == 0 ? cmsBuildParametricToneCurve(nullptr, 4, srgb.data()) : cmsBuildGamma(nullptr, space.gamma);
  const std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
  const cmsHPROFILE profile =
      grey ? cmsCreateGrayProfile(cmsD50_xyY(), curve) : cmsCreateRGBProfile(&white, &corners, curves.data());
  cmsFreeToneCurve(curve);
  return profile;
}

void put_big_endian(std::size_t value, std::uint8_t* to) {
  for (int k = 0; k < 4; ++k) to[k] = static_cast<std::uint8_t>(value >> 8 * (3 - k));
}

}  // namespace

Bytes icc_of(const Space& space, bool grey) {
  const cmsHPROFILE profile = profile_of(space, grey);
  cmsUInt32Number length = 0;
  cmsSaveProfileToMem(profile, nullptr, &length);
  Bytes bytes(length);
  cmsSaveProfileToMem(profile, bytes.data(), &length);
  cmsCloseProfile(profile);
  return bytes;
}

std::vector<double> by_definition(const std::vector<double>& rgb, const Space& from, const Space& to) {
  const Matrix in = to_xyz(from), out = to_xyz(to);
  std::vector<double> made;
  for (std::size_t k = 0; k < rgb.size(); k += 3) {
    std::array<double, 3> colour{};
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t c = 0; c < 3; ++c) colour[row] += in[row][c] * light_of(from, rgb[k + c]);
    }
    for (const double light : solved(out, colour)) made.push_back(level_of(to, light));
  }
  return made;
}

std::array<std::uint8_t, 3> chart_colour(int k) {
  constexpr std::array<std::uint8_t, 3> kLevels{20, 128, 235};
  if (k < 27) return {kLevels[k % 3 + 0U], kLevels[k / 3 % 3 + 0U], kLevels[k / 9 + 0U]};
  const auto grey = static_cast<std::uint8_t>(45 + 40 * (k - 27));
  return {grey, grey, grey};
}

Bytes chart() {
  Bytes rgb;
  for (int y = 0; y < kHigh; ++y) {
    for (int x = 0; x < kWide; ++x) {
      const std::array<std::uint8_t, 3> colour = chart_colour(x / kPatch + y / kPatch * (kWide / kPatch));
      rgb.insert(rgb.end(), colour.begin(), colour.end());
    }
  }
  return rgb;
}

std::vector<double> levels_of(const Bytes& bytes) {
  std::vector<double> levels;
  for (const std::uint8_t byte : bytes) levels.push_back(byte / 255.0);
  return levels;
}

Bytes with_chunk(Bytes png, const std::string& name, const Bytes& data) {
  Bytes chunk(data.size() + 12);
  put_big_endian(data.size(), chunk.data());
  std::copy(name.begin(), name.end(), chunk.begin() + 4);
  std::copy(data.begin(), data.end(), chunk.begin() + 8);
  put_big_endian(crc32(0, chunk.data() + 4, static_cast<uInt>(data.size() + 4)), chunk.data() + data.size() + 8);
  png.insert(png.begin() + 33, chunk.begin(), chunk.end());
  return png;
}

Bytes with_profile(const Bytes& png, const Bytes& icc) {
  Bytes packed(compressBound(icc.size()));
  uLongf length = packed.size();
  compress(packed.data(), &length, icc.data(), icc.size());
  Bytes data(3 + length);
  data[0] = 'p';
  std::copy_n(packed.begin(), length, data.begin() + 3);
  return with_chunk(png, "iCCP", data);
}

Bytes jpeg_with_profile(Bytes jpeg, const Bytes& icc) {
  Bytes segment{0xFF, 0xE2, static_cast<std::uint8_t>((icc.size() + 16) >> 8),
                static_cast<std::uint8_t>(icc.size() + 16)};
  for (const char c : std::string("ICC_PROFILE\0\1\1", 14)) segment.push_back(static_cast<std::uint8_t>(c));
  segment.insert(segment.end(), icc.begin(), icc.end());
  jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
  return jpeg;
}

Bytes deep_of(const Bytes& samples) {
  Bytes deep;
  for (const std::uint8_t level : samples) deep.insert(deep.end(), 2, level);
  return deep;
}

void write_tiff(const std::string& file, Bytes samples, const TiffForm& form, const Bytes& icc) {
  TIFF* tiff = TIFFOpen(file.c_str(), "w");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, form.width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, form.height);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, form.channels);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, form.bits);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, form.channels < 3 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, form.height);
  const auto kind = static_cast<std::uint16_t>(form.alpha);
  if (form.alpha >= 0) TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &kind);
  if (!icc.empty()) TIFFSetField(tiff, TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(icc.size()), icc.data());
  TIFFWriteEncodedStrip(tiff, 0, samples.data(), static_cast<tmsize_t>(samples.size()));
  TIFFClose(tiff);
}

std::vector<std::string> ColourCommand::write_chart(const Space& space) const {
  const Bytes rgb = chart(), icc = icc_of(space);
  const std::string name = space.name;
  test::write_bytes(path(name + "8.png"), with_profile(test::png_of(rgb, kWide, kHigh, 3), icc));
  test::write_bytes(path(name + "16.png"), with_profile(test::png_of(deep_of(rgb), kWide, kHigh, 3, 16), icc));
  write_tiff(path(name + "8.tif"), rgb, {}, icc);
  write_tiff(path(name + "16.tif"), deep_of(rgb), {.bits = 16}, icc);
  test::write_bytes(path(name + "8.jpg"),
                    jpeg_with_profile(test::jpeg_of(rgb, kWide, kHigh, test::Sampling::k444, 100), icc));
  return {name + "8.png", name + "16.png", name + "8.tif", name + "16.tif", name + "8.jpg"};
}

std::vector<double> ColourCommand::samples(const std::string& name) const {
  const bool tiff = name.ends_with(".tif");
  const std::string file = path(name);
  const Result<ImageHeader> header = tiff ? media::read_tiff_header(file) : media::read_image_header(file);
  const auto as = header->deep ? header->deep : std::optional(PixelFormat::kRgb24);
  const Result<DecodedImage> image = tiff ? media::read_tiff(file, header->deep) : media::read_image(file, as);
  const Bytes& bytes = image->bytes;
  const int channels = component_count(image->format);
  std::vector<double> levels;
  for (std::size_t k = 0; k < bytes.size() / (header->deep ? 2 : 1); ++k) {
    const double level = header->deep ? (bytes[2 * k] | bytes[2 * k + 1] << 8) / 65535.0 : bytes[k] / 255.0;
    levels.insert(levels.end(), channels == 1 ? 3 : 1, level);
  }
  return levels;
}

void ColourCommand::run(const Words& words) const {
  const Finished done = nodal(words);
  ASSERT_EQ(done.code, 0) << done.err;
}

double ColourCommand::largest_error(const std::vector<double>& got, const std::vector<double>& right) {
  EXPECT_EQ(got.size(), right.size());
  double worst = 0;
  for (int y = kPatch / 2; y < kHigh; y += kPatch) {
    for (int x = kPatch / 2; x < kWide; x += kPatch) {
      for (int c = 0; c < 3; ++c) {
        const auto at = static_cast<std::size_t>(3 * (y * kWide + x) + c);
        worst = std::max(worst, std::abs(got.at(at) - right.at(at)));
      }
    }
  }
  return worst;
}

}  // namespace nodal::command_line
