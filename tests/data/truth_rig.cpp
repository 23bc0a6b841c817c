#include "tests/data/truth_rig.h"

#include <array>
#include <nlohmann/json.hpp>
#include <optional>

namespace nodal::test_data {
namespace {

using nlohmann::json;

constexpr double kVignettingRadius = 423;  // from rig_gt.json's convention

/// Fields of one camera; the first missing one is recorded.
class Camera {
 public:
  explicit Camera(const json& fields) : fields_(fields) {}

  double number(const char* key) {
    if (fields_.is_object() && fields_.contains(key) && fields_[key].is_number()) return fields_[key].get<double>();
    if (missing_.empty()) missing_ = key;
    return 0;
  }

  std::array<double, 9> rotation() {
    std::array<double, 9> rows{};
    const bool good =
        fields_.is_object() && fields_.contains("R") && fields_["R"].is_array() && fields_["R"].size() == 9;
    for (std::size_t k = 0; good && k < 9; ++k) {
      if (fields_["R"][k].is_number()) rows[k] = fields_["R"][k].get<double>();
    }
    if (!good && missing_.empty()) missing_ = "R (nine numbers)";
    return rows;
  }

  std::string image() {
    if (fields_.is_object() && fields_.contains("image") && fields_["image"].is_string()) {
      return fields_["image"].get<std::string>();
    }
    if (missing_.empty()) missing_ = "image";
    return {};
  }

  const std::string& missing() const { return missing_; }

 private:
  const json& fields_;
  std::string missing_;
};

HeadCalibration to_head(Camera& camera, const std::string& image) {
  HeadCalibration head;
  head.name = image.substr(0, image.find('.'));
  head.width = static_cast<int>(camera.number("width"));
  head.height = static_cast<int>(camera.number("height"));
  head.center_x = camera.number("cx") + 0.5;
  head.center_y = camera.number("cy") + 0.5;
  head.aspect = camera.number("ay");
  head.lens = TsaiLens{camera.number("f"), camera.number("k1"), camera.number("k2")};
  head.R_head_rig = camera.rotation();
  head.region = {0, 0, static_cast<double>(head.width), static_cast<double>(head.height), {}};
  head.vignetting = {head.center_x, head.center_y, kVignettingRadius, {camera.number("v2"), camera.number("v4"), 0}};
  const double gain = camera.number("gain");
  head.gain = {gain, gain, gain};
  return head;
}

}  // namespace

Result<TruthRig> read_truth_rig(std::string_view text) {
  const json document = json::parse(text, nullptr, false);
  if (document.is_discarded()) return fail(Errc::kBadFormat, "it is not JSON");
  if (!document.is_object() || !document.contains("cameras") || !document["cameras"].is_array()) {
    return fail(Errc::kMissingField, "it has no list 'cameras'");
  }
  TruthRig rig;
  rig.calibration.name = "truth";
  rig.calibration.comment = "The rig that the pictures were rendered with.";
  for (const json& fields : document["cameras"]) {
    Camera camera(fields);
    rig.images.push_back(camera.image());
    rig.calibration.heads.push_back(to_head(camera, rig.images.back()));
    if (!camera.missing().empty()) {
      return fail(Errc::kMissingField,
                  "cameras[" + std::to_string(rig.images.size() - 1) + "] has no " + camera.missing());
    }
  }
  // Twelve digits of a rotation are not exact: parsing the document makes it orthonormal.
  Result<Calibration> checked = parse_calibration(to_json(rig.calibration));
  if (!checked) return fail(checked.error());
  rig.calibration = std::move(*checked);
  return rig;
}

std::string replay_rig_toml(const TruthRig& rig, std::string_view folder, std::string_view format, int width) {
  std::string text =
      "# Replays the pictures of a rendered rig.\n[rig]\nname = \"truth\"\nrate = \"30000/1001\"\n\n[raymap]\n";
  text += "layout = \"equirectangular\"\nwidth = " + std::to_string(width) + "\nheight = " + std::to_string(width / 2) +
          "\n";
  text += "format = \"" + std::string(format) + "\"\njpeg_quality = 95\nfeather = 0.05\n\n[trigger]\nstart = true\n\n";
  text += "[links]\nunix = \"nodal.sock\"\n\n[store]\nfolder = \"store\"\n";
  for (std::size_t i = 0; i < rig.images.size(); ++i) {
    text += "\n[[heads]]\nname = \"" + rig.calibration.heads[i].name +
            "\"\nport = " + json("replay:" + std::string(folder) + "/" + rig.images[i]).dump() + "\nformat = \"" +
            std::string(format) + "\"\n";
  }
  return text;
}

}  // namespace nodal::test_data
