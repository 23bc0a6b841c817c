#include "stitch/media/colour/profiles.h"

#include <array>
#include <vector>

#include "stitch/media/colour/colour.h"

namespace nodal::media {
namespace {

constexpr std::array<double, 8> kSrgb{0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
/// Of IEC 61966-2-1, as Little CMS's parametric curve 4: (a X + b)^g from d on, else c X.
constexpr std::array<double, 5> kSrgbCurve{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};

struct FreeCurve {
  void operator()(cmsToneCurve* curve) const { cmsFreeToneCurve(curve); }
};
using Curve = std::unique_ptr<cmsToneCurve, FreeCurve>;

Curve srgb_curve() { return Curve(cmsBuildParametricToneCurve(nullptr, 4, kSrgbCurve.data())); }
Curve gamma_curve(double gamma) { return Curve(cmsBuildGamma(nullptr, gamma)); }

Profile made(const std::array<double, 8>& primaries, const Curve& curve, bool grey) {
  const cmsCIExyY white{primaries[0], primaries[1], 1};
  if (!curve) return nullptr;
  // The white of a grey profile does not matter, as long as it is that of the space between.
  if (grey) return Profile(cmsCreateGrayProfile(cmsD50_xyY(), curve.get()));
  const cmsCIExyYTRIPLE corners{
      {primaries[2], primaries[3], 1}, {primaries[4], primaries[5], 1}, {primaries[6], primaries[7], 1}};
  const std::array<cmsToneCurve*, 3> curves{curve.get(), curve.get(), curve.get()};
  return Profile(cmsCreateRGBProfile(&white, &corners, curves.data()));
}

}  // namespace

Profile plain_profile(bool linear, bool grey) { return made(kSrgb, linear ? gamma_curve(1) : srgb_curve(), grey); }

Profile profile_of(const SampleMeaning& meaning, bool grey) {
  if (!meaning.icc.empty()) {
    return Profile(cmsOpenProfileFromMem(meaning.icc.data(), static_cast<cmsUInt32Number>(meaning.icc.size())));
  }
  const bool gamma = meaning.curve == SampleMeaning::Curve::kGamma;
  return made(meaning.primaries.value_or(kSrgb), gamma ? gamma_curve(meaning.gamma) : srgb_curve(), grey);
}

bool is_linear_profile(cmsHPROFILE profile) {
  const bool grey = cmsGetColorSpace(profile) == cmsSigGrayData;
  for (const cmsTagSignature tag : {cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag}) {
    const void* curve = cmsReadTag(profile, grey ? cmsSigGrayTRCTag : tag);
    if (curve == nullptr || cmsIsToneCurveLinear(static_cast<const cmsToneCurve*>(curve)) == 0) return false;
  }
  // With a table for colours the curves do not say it all.
  return cmsIsTag(profile, cmsSigAToB0Tag) == 0;
}

std::vector<std::uint8_t> linear_profile(bool grey) {
  const Profile profile = plain_profile(true, grey);
  cmsUInt32Number length = 0;
  constexpr double kOldEnough = 2.1;  // version of ICC's format that every program reads
  if (profile) cmsSetProfileVersion(profile.get(), kOldEnough);
  if (!profile || cmsSaveProfileToMem(profile.get(), nullptr, &length) == 0) return {};
  std::vector<std::uint8_t> bytes(length);
  if (cmsSaveProfileToMem(profile.get(), bytes.data(), &length) == 0) return {};
  // The time at which it was made, which would make two runs differ (ICC.1:2010, 7.2: bytes 24 to 35).
  constexpr std::array<std::uint8_t, 12> kAnyTime{0x07, 0xE8, 0, 1, 0, 1};
  for (std::size_t k = 0; k < kAnyTime.size() && 24 + k < bytes.size(); ++k) bytes[24 + k] = kAnyTime[k];
  return bytes;
}

}  // namespace nodal::media
