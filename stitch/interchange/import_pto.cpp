// Hugin's project file. Its pixel centres are at integers, its angles are in degrees (yaw, pitch, roll).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/calibration_limits.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/panotools_fields.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/panotools_masks.h"
#include "stitch/interchange/panotools_script.h"
#include "stitch/interchange/photometry.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

constexpr std::size_t kMaxNameInNote = 200;  // bytes

/// How Hugin corrects vignetting: the bits of Vm.
constexpr int kByPolynomial = 1, kByFlatField = 2;

Result<Photometry> read_photometry(const ImageLines& images, std::size_t image, const HeadCalibration& head,
                                   std::vector<std::string>& notes) {
  Photometry p;
  double method = kByPolynomial;
  std::array<double, 5> R{};
  const std::array<std::pair<const char*, double*>, 15> variables{{{"Eev", &p.stops},
                                                                   {"Er", p.balance.data()},
                                                                   {"Eb", &p.balance[2]},
                                                                   {"Va", p.V.data()},
                                                                   {"Vb", &p.V[1]},
                                                                   {"Vc", &p.V[2]},
                                                                   {"Vd", &p.V[3]},
                                                                   {"Vx", &p.Vx},
                                                                   {"Vy", &p.Vy},
                                                                   {"Vm", &method},
                                                                   {"Ra", R.data()},
                                                                   {"Rb", &R[1]},
                                                                   {"Rc", &R[2]},
                                                                   {"Rd", &R[3]},
                                                                   {"Re", &R[4]}}};
  for (const auto& [name, value] : variables) {
    NODAL_TRY_ASSIGN(const double number, images.number_or(image, name, *value));
    *value = number;
  }
  const std::string line = fmt::format("line {}", images[image].number);
  if (!(p.V[0] > 0)) return fail(Errc::kBadValue, line + ": vignetting Va must be more than 0");
  if (!(method >= 0 && method <= 15)) return fail(Errc::kBadValue, line + ": vignetting Vm must be 0 to 15");
  p.radius = std::hypot(head.width, head.height) / 2;
  p.fitted = std::ranges::any_of(R, [](double r) { return r != 0; });
  const int how = static_cast<int>(method);
  if ((how & kByPolynomial) == 0) p.V = {1, 0, 0, 0};
  if ((how & kByFlatField) != 0) {
    notes.push_back(fmt::format(
        "Head '{}' has its vignetting corrected by a picture of a flat field (Vm{}): it is left out.", head.name, how));
  }
  return p;
}

Result<int> picture_side(const ImageLines& images, std::size_t image, const char* name) {
  NODAL_TRY_ASSIGN(const std::optional<double> side, images.find_number(image, name));
  const std::string line = fmt::format("line {}", images[image].number);
  if (!side) return fail(Errc::kMissingField, line + ": the image has no " + name + " (its size)");
  if (!(*side >= 1 && *side <= 32768))
    return fail(Errc::kBadValue, line + ": the image's " + name + " must be 1 to 32768");
  return static_cast<int>(*side);
}

Result<HeadCalibration> read_head(const ImageLines& images, std::size_t image, const std::vector<std::string>& taken,
                                  std::vector<std::string>& notes) {
  PanotoolsImage read;
  const std::string* file = images[image].find("n");
  read.name = head_name(file == nullptr ? "" : *file, taken);
  NODAL_TRY_ASSIGN(const int width, picture_side(images, image, "w"));
  NODAL_TRY_ASSIGN(const int height, picture_side(images, image, "h"));
  read.width = width;
  read.height = height;
  NODAL_TRY(read_geometry(images, image, read));
  read.lens = {0, static_cast<double>(width), 0, static_cast<double>(height)};
  if (const std::string* kept = images[image].find("S")) {
    NODAL_TRY_ASSIGN(const auto crop, to_four_numbers(images[image], "S", *kept));
    read.region = Crop{crop[0], crop[1], crop[2], crop[3]};
  }
  return to_head(read, notes);
}

/// The image lines, without those that are switched off; links count all of them.
struct HuginImages {
  ImageLines all;
  std::vector<std::size_t> used;                    ///< indices in `all`
  std::vector<std::string> disabled;                ///< pictures
  std::vector<std::optional<std::size_t>> head_of;  ///< each image's head
};

constexpr std::string_view kAttributes = "#-hugin", kSettings = "#hugin_";

HuginImages sort_lines(const std::vector<ScriptLine>& lines) {
  HuginImages project;
  bool disabled = false;
  for (const ScriptLine& line : lines) {
    if (line.comment.starts_with(kAttributes)) {
      const std::vector<Attribute> all = attributes_of(line.comment.substr(kAttributes.size()));
      disabled = std::ranges::any_of(all, [](const Attribute& a) { return a.name == "disabled"; });
    }
    if (line.kind != 'i') continue;
    const std::size_t image = project.all.size();
    project.all.add(&line);
    if (disabled) {
      const std::string* file = line.find("n");
      project.disabled.push_back(file == nullptr ? fmt::format("image {}", image) : *file);
      project.head_of.emplace_back();
    } else {
      project.head_of.emplace_back(project.used.size());
      project.used.push_back(image);
    }
    disabled = false;
  }
  return project;
}

/// Compares the fields of all lines with the table; of images that are switched off, none.
Status check_hugin_fields(const std::vector<ScriptLine>& lines, const HuginImages& project, ImportResult& result) {
  FieldCheck check(hugin_fields());
  std::size_t image = 0;
  for (const ScriptLine& line : lines) {
    if (line.comment.starts_with(kAttributes)) {
      for (const Attribute& a : attributes_of(line.comment.substr(kAttributes.size())))
        check.see("#-hugin", a.name, a.value);
    } else if (line.comment.starts_with(kSettings)) {
      const Attribute setting = setting_of(line.comment.substr(kSettings.size()));
      check.see(kSettings, setting.name, setting.value);
    }
    if (line.kind == '#') continue;
    check.see("file", line.kind == '*' ? "end" : std::string(1, line.kind), "");
    if (line.kind == 'c' || line.kind == 'k') see_variables(line, check);
    if (line.kind != 'i') continue;
    const std::optional<std::size_t> head = project.head_of[image];
    if (head) {
      NODAL_TRY(see_image(project.all, image, "i", "head '" + result.calibration.heads[*head].name + "'", check));
    }
    ++image;
  }
  return check.tell(result.notes);
}

}  // namespace

Result<ImportResult> import_pto(std::string_view text, std::string_view name) {
  NODAL_TRY_ASSIGN(const std::vector<ScriptLine> lines, parse_script(text, kMaxProjectBytes));
  HuginImages project = sort_lines(lines);
  const ImageLines& images = project.all;
  if (images.size() == 0) return fail(Errc::kBadFormat, "there is no image line (i) in it: it is not a Hugin project");
  if (images.size() > kMaxCalibratedHeads) {
    return fail(Errc::kUnsupported, fmt::format("the project has {} images; a calibration has 1 to {} heads",
                                                images.size(), kMaxCalibratedHeads));
  }
  if (project.used.empty()) {
    return fail(Errc::kUnsupported, "all images of the project are disabled in Hugin; enable those that are heads");
  }

  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a Hugin project.";
  for (const std::string& picture : project.disabled) {
    result.notes.push_back("'" + printable(picture, kMaxNameInNote) + "' is disabled in the project: it is no head.");
  }
  std::vector<Photometry> photometry;
  std::vector<std::string> taken;
  for (const std::size_t i : project.used) {
    NODAL_TRY_ASSIGN(HeadCalibration head, read_head(images, i, taken, result.notes));
    taken.push_back(head.name);
    const std::string* file = images[i].find("n");
    result.images.push_back(file == nullptr ? "" : *file);
    NODAL_TRY_ASSIGN(const Photometry read, read_photometry(images, i, head, result.notes));
    photometry.push_back(read);
    result.calibration.heads.push_back(std::move(head));
  }
  set_photometry(photometry, result);
  if (std::ranges::any_of(photometry, &Photometry::fitted)) {
    result.notes.push_back(
        "Hugin's fitted response curve (Ra..Re) has no counterpart here: the mean camera curve it starts from "
        "stands in for it, so exposure and vignetting are made up for only roughly.");
  }
  std::vector<const ScriptLine*> masks;
  for (const ScriptLine& line : lines) {
    if (line.kind == 'k') masks.push_back(&line);
  }
  NODAL_TRY(add_masks(masks, project.head_of, result));
  NODAL_TRY(add_control_points(lines, project.head_of, result));
  NODAL_TRY(check_hugin_fields(lines, project, result));
  NODAL_TRY(check_calibration(result.calibration));
  return result;
}

}  // namespace nodal::interchange
