// Hugin's project file. Its pixel centres are at integers, its angles are in degrees (yaw, pitch, roll).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "protocol/base/units.h"
#include "protocol/calibration_limits.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/panotools_masks.h"
#include "stitch/interchange/panotools_script.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

/// Light from encoded value in Hugin's response for Ra..Re = 0, EMoR's mean over many cameras: a polynomial fitted to
/// nona 2022's output for a ramp at eight exposures from -2 to 4 stops, to 0.08 levels of 255 rms.
constexpr std::array kMeanResponse{0.104165639,   2.518528026,    -12.713087053, 45.847686835, -107.436831174,
                                   161.911780617, -147.637115033, 74.004003159,  -15.599131016};

/// One image's photometric variables: L = resp^-1(I) 2^(Eev - E) / V(r), red / Er, blue / Eb.
struct Photometry {
  double Eev = 0, Er = 1, Eb = 1;
  std::array<double, 4> V{1, 0, 0, 0};
  double Vx = 0, Vy = 0;
  std::array<double, 5> R{};

  bool falls_off() const { return V[1] != 0 || V[2] != 0 || V[3] != 0; }
};

Result<Photometry> read_photometry(const ImageLines& images, std::size_t image) {
  Photometry p;
  const std::array<std::pair<const char*, double*>, 14> variables{{{"Eev", &p.Eev},
                                                                   {"Er", &p.Er},
                                                                   {"Eb", &p.Eb},
                                                                   {"Va", &p.V[0]},
                                                                   {"Vb", &p.V[1]},
                                                                   {"Vc", &p.V[2]},
                                                                   {"Vd", &p.V[3]},
                                                                   {"Vx", &p.Vx},
                                                                   {"Vy", &p.Vy},
                                                                   {"Ra", &p.R[0]},
                                                                   {"Rb", &p.R[1]},
                                                                   {"Rc", &p.R[2]},
                                                                   {"Rd", &p.R[3]},
                                                                   {"Re", &p.R[4]}}};
  for (const auto& [name, value] : variables) {
    const Result<double> number = images.number_or(image, name, *value);
    if (!number) return fail(number.error());
    *value = *number;
  }
  if (!(p.V[0] > 0)) {
    return fail(Errc::kBadValue,
                "line " + std::to_string(images[image].number) + ": vignetting Va must be more than 0");
  }
  return p;
}

Result<int> picture_side(const ImageLines& images, std::size_t image, const char* name) {
  const Result<std::optional<double>> side = images.find_number(image, name);
  if (!side) return fail(side.error());
  const std::string line = "line " + std::to_string(images[image].number);
  if (!*side) return fail(Errc::kMissingField, line + ": the image has no " + name + " (its size)");
  if (!(**side >= 1 && **side <= 32768))
    return fail(Errc::kBadValue, line + ": the image's " + name + " must be 1 to 32768");
  return static_cast<int>(**side);
}

Result<HeadCalibration> read_head(const ImageLines& images, std::size_t image, const std::vector<std::string>& taken,
                                  std::vector<std::string>& notes) {
  PanotoolsImage read;
  const std::string* file = images[image].find("n");
  read.name = head_name(file == nullptr ? "" : *file, taken);
  const Result<int> width = picture_side(images, image, "w");
  if (!width) return fail(width.error());
  const Result<int> height = picture_side(images, image, "h");
  if (!height) return fail(height.error());
  read.width = *width;
  read.height = *height;
  if (Status s = read_geometry(images, image, read); !s) return fail(s.error());
  read.lens = {0, static_cast<double>(*width), 0, static_cast<double>(*height)};
  if (const std::string* kept = images[image].find("S")) {
    const Result<std::array<double, 4>> crop = to_four_numbers(images[image], "S", *kept);
    if (!crop) return fail(crop.error());
    read.region = Crop{(*crop)[0], (*crop)[1], (*crop)[2], (*crop)[3]};
  }
  for (const char* name : {"g", "t", "TrX", "TrY", "TrZ", "Tpy", "Tpp"}) {
    const Result<double> value = images.number_or(image, name, 0);
    if (!value) return fail(value.error());
    if (*value != 0) {
      notes.push_back("Head '" + read.name + "' has " + name + " = " + short_number(*value) +
                      (name[0] == 'T' ? ", a shift of its viewpoint" : ", a shear of its picture") +
                      ": Nodal has none, and leaves it out.");
    }
  }
  return to_head(read, notes);
}

/// Sets gains relative to the rig's mean exposure, vignetting, and the response as far as it is known.
void set_photometry(const std::vector<Photometry>& all, ImportResult& result) {
  double mean = 0;
  for (const Photometry& p : all) mean += p.Eev / static_cast<double>(all.size());
  bool any = false, bent = false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Photometry& p = all[i];
    HeadCalibration& head = result.calibration.heads[i];
    const double gain = std::exp2(mean - p.Eev);
    head.gain = {gain * p.Er, gain, gain * p.Eb};
    head.vignetting = {head.width / 2.0 + p.Vx,
                       head.height / 2.0 + p.Vy,
                       std::hypot(head.width, head.height) / 2,
                       {p.V[1] / p.V[0], p.V[2] / p.V[0], p.V[3] / p.V[0]}};
    if (!check_head(head) && p.falls_off()) {
      head.vignetting.coefficients = {};
      result.notes.push_back("The vignetting of head '" + head.name + "' goes dark inside its picture: left out.");
    }
    any = any || p.falls_off() || std::abs(gain - 1) > 1e-9 || p.Er != 1 || p.Eb != 1;
    bent = bent || std::ranges::any_of(p.R, [](double r) { return r != 0; });
  }
  // The response matters only if there are exposures or vignetting to compensate.
  if (!any && !bent) return;
  for (HeadCalibration& head : result.calibration.heads) {
    head.response = {Response::Curve::kPolynomial, 1, {kMeanResponse.begin(), kMeanResponse.end()}};
  }
  if (!bent) return;
  result.notes.push_back(
      "Hugin's fitted response curve (Ra..Re) has no counterpart here: the mean camera curve it starts from "
      "stands in for it, so exposure and vignetting are made up for only roughly.");
}

}  // namespace

Result<ImportResult> import_pto(std::string_view text, std::string_view name) {
  const Result<std::vector<ScriptLine>> lines = parse_script(text, kMaxProjectBytes);
  if (!lines) return fail(lines.error());
  ImageLines images;
  std::vector<const ScriptLine*> masks;
  for (const ScriptLine& line : *lines) {
    if (line.kind == 'i') images.add(&line);
    if (line.kind == 'k') masks.push_back(&line);
  }
  if (images.size() == 0) return fail(Errc::kBadFormat, "there is no image line (i) in it: it is not a Hugin project");
  if (images.size() > kMaxCalibratedHeads) {
    return fail(Errc::kUnsupported, "the project has " + std::to_string(images.size()) +
                                        " images; a calibration has 1 to " + std::to_string(kMaxCalibratedHeads) +
                                        " heads");
  }

  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a Hugin project.";
  std::vector<Photometry> photometry;
  std::vector<std::string> taken;
  for (std::size_t i = 0; i < images.size(); ++i) {
    Result<HeadCalibration> head = read_head(images, i, taken, result.notes);
    if (!head) return fail(head.error());
    taken.push_back(head->name);
    const std::string* file = images[i].find("n");
    result.images.push_back(file == nullptr ? "" : *file);
    result.calibration.heads.push_back(std::move(*head));
    const Result<Photometry> read = read_photometry(images, i);
    if (!read) return fail(read.error());
    photometry.push_back(*read);
  }
  set_photometry(photometry, result);
  if (Status s = add_masks(masks, result); !s) return fail(s.error());
  if (Status s = add_control_points(*lines, 0, result); !s) return fail(s.error());
  if (Status s = check_calibration(result.calibration); !s) return fail(s.error());
  return result;
}

}  // namespace nodal::interchange
