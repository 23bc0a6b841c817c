#include "stitch/media/colour/colour.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "stitch/media/colour/profiles.h"

namespace nodal::media {
namespace {

struct DeleteTransform {
  void operator()(void* transform) const { cmsDeleteTransform(transform); }
};
using Transform = std::unique_ptr<void, DeleteTransform>;

constexpr std::size_t kPixelsAtOnce = 4096;

/// From one of a picture's kinds of pixels to another.
struct Kinds {
  bool grey_in = false, grey_out = false, deep = false;

  cmsUInt32Number in() const { return kind(grey_in); }
  cmsUInt32Number out() const { return kind(grey_out); }

 private:
  cmsUInt32Number kind(bool grey) const {
    if (deep) return grey ? TYPE_GRAY_16 : TYPE_RGB_16;
    return grey ? TYPE_GRAY_8 : TYPE_RGB_8;
  }
};

Transform transform_of(const Profile& from, bool linear, const Kinds& kinds) {
  const Profile to = plain_profile(linear, kinds.grey_out);
  // Little CMS's shortcuts for 16 bits are tables, with errors of hundreds of 65535.
  const cmsUInt32Number flags =
      cmsFLAGS_NOCACHE | cmsFLAGS_BLACKPOINTCOMPENSATION | (kinds.deep ? cmsFLAGS_NOOPTIMIZE : 0U);
  return Transform(
      cmsCreateTransform(from.get(), kinds.in(), to.get(), kinds.out(), INTENT_RELATIVE_COLORIMETRIC, flags));
}

/// Whether the transform leaves samples of 8 bits as they are, to a level: then the file's own are kept.
bool changes_nothing(const Profile& from, bool grey) {
  const Transform transform = transform_of(from, false, {grey, grey, false});
  if (!transform) return false;
  constexpr int kStep = 15, kSide = 18;
  for (int r = 0; r < kSide; ++r) {
    for (int g = 0; g < (grey ? 1 : kSide); ++g) {
      for (int b = 0; b < (grey ? 1 : kSide); ++b) {
        const std::array<std::uint8_t, 3> in{static_cast<std::uint8_t>(kStep * r), static_cast<std::uint8_t>(kStep * g),
                                             static_cast<std::uint8_t>(kStep * b)};
        std::array<std::uint8_t, 3> out{};
        cmsDoTransform(transform.get(), in.data(), out.data(), 1);
        for (std::size_t c = 0; c < (grey ? 1 : 3); ++c) {
          if (std::abs(in[c] - out[c]) > 1) return false;
        }
      }
    }
  }
  return true;
}

/// A grey picture whose profile is for colours: each level as a neutral colour.
void transform_grey_by_colours(const Transform& transform, std::vector<std::uint8_t>& bytes, std::size_t sample_bytes) {
  std::vector<std::uint8_t> in(3 * sample_bytes * kPixelsAtOnce), out(in.size());
  const std::size_t count = bytes.size() / sample_bytes;
  for (std::size_t begin = 0; begin < count; begin += kPixelsAtOnce) {
    const std::size_t some = std::min(kPixelsAtOnce, count - begin);
    for (std::size_t k = 0; k < 3 * some; ++k) {
      std::memcpy(&in[k * sample_bytes], &bytes[(begin + k / 3) * sample_bytes], sample_bytes);
    }
    cmsDoTransform(transform.get(), in.data(), out.data(), static_cast<cmsUInt32Number>(some));
    for (std::size_t k = 0; k < some; ++k) {
      std::memcpy(&bytes[(begin + k) * sample_bytes], &out[(3 * k + 1) * sample_bytes], sample_bytes);
    }
  }
}

Error unfit(const std::string& name, const std::string& what) {
  return {Errc::kUnsupported, "picture '" + name + "': its colour profile " + what +
                                  "; save it as sRGB, or remove the profile: exiftool -icc_profile= FILE"};
}

double to_srgb(double light) { return light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1 / 2.4) - 0.055; }

}  // namespace

bool needs_conversion(const SampleMeaning& meaning) {
  return !meaning.unread.empty() || !meaning.icc.empty() || meaning.primaries ||
         meaning.curve == SampleMeaning::Curve::kGamma;
}

Status in_srgb(DecodedImage& picture, const std::string& name) {
  SampleMeaning& meaning = picture.meaning;
  const bool deep = is_linear16(picture.format);
  if (!needs_conversion(meaning)) return {};
  if (!meaning.unread.empty()) {
    return fail(Errc::kUnsupported, "picture '" + name + "': its colours are given by " + meaning.unread +
                                        ", which is not converted; save it as sRGB");
  }
  if (deep && meaning.is_linear() && !meaning.primaries) return {};
  const bool grey = in_8_bits(picture.format) == PixelFormat::kGrey8;
  const Profile from = profile_of(meaning, grey);
  if (!from) return fail(unfit(name, "is broken"));
  const cmsColorSpaceSignature space = cmsGetColorSpace(from.get());
  if (space != cmsSigRgbData && space != cmsSigGrayData) return fail(unfit(name, "is not for RGB or grey pictures"));
  const bool linear = deep && is_linear_profile(from.get());
  const bool grey_profile = space == cmsSigGrayData;
  SampleMeaning after = linear ? SampleMeaning::linear() : SampleMeaning::srgb();
  after.alpha = meaning.alpha;
  after.full_exposure_ns = meaning.full_exposure_ns;
  if (linear || !changes_nothing(from, grey_profile)) {
    const Transform transform = transform_of(from, linear, {grey_profile, grey_profile, deep});
    if (!transform) return fail(unfit(name, "cannot be used"));
    const std::size_t sample_bytes = deep ? 2 : 1;
    if (grey && !grey_profile) {
      transform_grey_by_colours(transform, picture.bytes, sample_bytes);
    } else {
      // A grey profile converts the samples of a picture in colours one by one.
      const std::size_t pixel_bytes = sample_bytes * (grey_profile ? 1 : 3);
      for (std::size_t begin = 0; begin < picture.bytes.size(); begin += kPixelsAtOnce * pixel_bytes) {
        const std::size_t some = std::min(kPixelsAtOnce, (picture.bytes.size() - begin) / pixel_bytes);
        cmsDoTransform(transform.get(), &picture.bytes[begin], &picture.bytes[begin],
                       static_cast<cmsUInt32Number>(some));
      }
    }
  }
  meaning = std::move(after);
  return {};
}

DecodedImage shown_in_8_bits(const DecodedImage& deep) {
  const bool linear = deep.meaning.is_linear();
  std::vector<std::uint8_t> levels(65536);
  for (std::size_t k = 0; k < levels.size(); ++k) {
    const double part = static_cast<double>(k) / 65535;
    levels[k] = static_cast<std::uint8_t>(std::lround(255 * (linear ? to_srgb(part) : part)));
  }
  DecodedImage shown{in_8_bits(deep.format), deep.width, deep.height, {}};
  shown.meaning = linear ? SampleMeaning::srgb() : deep.meaning;
  shown.metadata = deep.metadata;
  shown.bytes.resize(deep.bytes.size() / 2);
  for (std::size_t k = 0; k < shown.bytes.size(); ++k) {
    shown.bytes[k] = levels[static_cast<std::size_t>(deep.bytes[2 * k] | deep.bytes[2 * k + 1] << 8)];
  }
  return shown;
}

}  // namespace nodal::media
