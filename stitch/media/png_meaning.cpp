#include "stitch/media/png_meaning.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>

#include "stitch/media/code_points.h"
#include "stitch/media/known_curve.h"
#include "stitch/media/linear_words.h"

namespace nodal::media {
namespace {

/// Chunks that libpng leaves to us: the second it does not know.
constexpr png_byte kChunkNames[] = {'i', 'C', 'C', 'P', '\0', 'c', 'I', 'C', 'P', '\0'};
constexpr std::string_view kIccpName = "iCCP", kCicpName = "cICP";
constexpr int kSrgbGamma = 45455, kLinearGamma = 100000;  ///< values of gAMA
constexpr int kSameGamma = 500;

/// The profile of an iCCP chunk: a name, a zero, the method of compression, compressed bytes. One that cannot be
/// decompressed is a byte long, so that it is not taken for no profile.
std::vector<std::uint8_t> profile_of(std::span<const std::uint8_t> chunk) {
  const auto name_end = std::ranges::find(chunk, std::uint8_t{0});
  if (chunk.end() - name_end < 3) return {0};
  const std::span<const std::uint8_t> packed(name_end + 2, chunk.end());
  std::vector<std::uint8_t> profile(kMaxPngChunkBytes);
  uLongf length = profile.size();
  if (uncompress(profile.data(), &length, packed.data(), packed.size()) != Z_OK || length == 0) return {0};
  profile.resize(length);
  profile.shrink_to_fit();
  return profile;
}

void read_curve(png_structp png, png_infop info, SampleMeaning& meaning) {
  if (png_get_valid(png, info, PNG_INFO_sRGB) != 0) {
    meaning.curve = SampleMeaning::Curve::kSrgb;
    return;
  }
  png_fixed_point gamma = 0;
  if (png_get_gAMA_fixed(png, info, &gamma) != 0 && gamma > 0) {
    const bool srgb = std::abs(gamma - kSrgbGamma) <= kSameGamma;
    meaning.curve = srgb ? SampleMeaning::Curve::kSrgb : SampleMeaning::Curve::kGamma;
    meaning.gamma = std::abs(gamma - kLinearGamma) <= kSameGamma ? 1 : 1e5 / gamma;
  }
  std::array<double, 8> xy{};
  if (png_get_cHRM(png, info, &xy[0], &xy[1], &xy[2], &xy[3], &xy[4], &xy[5], &xy[6], &xy[7]) == 0) return;
  if (!is_srgb_primaries(xy)) meaning.primaries = xy;
}

}  // namespace

void limit_chunks(png_structp png) {
  png_set_chunk_malloc_max(png, kMaxPngChunkBytes);
  png_set_chunk_cache_max(png, kMaxPngTexts);
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_ALWAYS, kChunkNames, 2);
}

void read_meaning(png_structp png, png_infop info, SampleMeaning& meaning, FileMetadata& metadata) {
  read_curve(png, info, meaning);
  png_unknown_chunkp chunks = nullptr;
  const int unknown = png_get_unknown_chunks(png, info, &chunks);
  std::span<const std::uint8_t> cicp;
  for (int k = 0; k < unknown; ++k) {
    const std::string_view name(reinterpret_cast<const char*>(chunks[k].name), 4);
    const std::span<const std::uint8_t> data(chunks[k].data, chunks[k].size);
    if (name == kIccpName && meaning.icc.empty()) meaning.icc = profile_of(data);
    if (name == kCicpName && cicp.empty()) cicp = data;
  }
  // It counts before iCCP, sRGB, gAMA and cHRM (PNG, third edition, 4.3).
  if (cicp.size() == 4) set_code_points(cicp.first<4>(), meaning);
  png_textp texts = nullptr;
  int count = 0;
  png_get_text(png, info, &texts, &count);
  for (int k = 0; k < count; ++k) {
    const std::string_view key(texts[k].key), text(texts[k].text);
    if (key == "XML:com.adobe.xmp") metadata.xmp = text;
    if (key == "Comment") meaning.full_exposure_ns = full_exposure_said(text);
  }
  png_bytep exif = nullptr;
  png_uint_32 length = 0;
  if (png_get_eXIf_1(png, info, &length, &exif) != 0 && exif != nullptr) metadata.exif.assign(exif, exif + length);
}

}  // namespace nodal::media
