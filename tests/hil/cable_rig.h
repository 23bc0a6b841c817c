// nodald on a cable, as an ordinary user, as with its systemd unit; and the command nodal.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cable_gadget.h"
#include "tests/support/process.h"

namespace nodal::hil {

inline const std::string kScratch = "/tmp/cable-rig";  ///< a folder in the guest's memory

inline std::string content(const std::string& file) {
  std::ifstream from(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(from), {}};
}

/// A copy of a file or program of the checkout, which may lie where only its owner may look.
inline std::string for_everybody(const std::string& file) {
  const std::filesystem::path copy = std::filesystem::path(kScratch) / std::filesystem::path(file).filename();
  std::filesystem::create_directories(kScratch);
  std::filesystem::copy_file(file, copy, std::filesystem::copy_options::skip_existing);
  return copy.string();
}

inline std::vector<std::string> as_nobody(std::vector<std::string> words) {
  words.insert(words.begin(), {"setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups"});
  return words;
}

/// The command `nodal --json` on a rig.
inline test::Finished nodal(const std::string& rig, std::vector<std::string> words) {
  words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", rig, "--json"});
  return test::Process(words).wait();
}

/// A rig with two heads, whose raymaps are all equal to the byte: a scene without motion and noise.
class CableNodald {
 public:
  explicit CableNodald(const CableGadget& gadget) : gadget_(gadget), folder_(kScratch + "/" + gadget.serial()) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    const std::string photo = for_everybody(NODAL_SOURCE_DIR "/.github/pictures/town_square.jpg");
    std::ofstream(folder_ + "/rig.toml")
        << "[rig]\nname = \"rig-" << gadget.serial() << "\"\nrate = \"20\"\n[raymap]\nwidth = 1024\nheight = 512\n"
        << "[trigger]\nstart = true\n[links]\nunix = \"nodal.sock\"\nusb = \"" << gadget.folder()
        << "\"\n[store]\nfolder = \"store\"\n[takes]\nfolder = \"takes\"\nbuffer_mb = 64\nmode = "
           "\"jpeg\"\n[sim]\ncalibration = \""
        << calibration() << "\"\n"
        << "scene = \"photo\"\nphoto = \"" << photo << "\"\n"
        << "[[heads]]\nname = \"cam0\"\nport = \"sim:cam0\"\n[[heads]]\nname = \"cam1\"\nport = \"sim:cam1\"\n";
    nlohmann::json two = nlohmann::json::parse(content(NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json"));
    two["heads"].erase(two["heads"].begin() + 2, two["heads"].end());
    std::ofstream(calibration()) << two.dump();
    for (const auto& entry : std::filesystem::recursive_directory_iterator(kScratch)) {
      EXPECT_EQ(::chown(entry.path().c_str(), kNobody, kNobody), 0);
    }
    nodald_ = std::make_unique<test::Process>(
        as_nobody({for_everybody(NODAL_BIN_DIR "/nodald"), "--config", folder_ + "/rig.toml"}));
    EXPECT_TRUE(test::wait_until([&] { return std::filesystem::exists(folder_ + "/nodal.sock"); }))
        << nodald_->complained();
    gadget_.plug();
  }

  std::string calibration() const { return folder_ + "/two.json"; }
  std::string by_socket() const { return "unix:" + folder_ + "/nodal.sock"; }
  std::string by_cable() const { return "usb:" + gadget_.serial(); }
  test::Process& nodald() { return *nodald_; }

  static constexpr uid_t kNobody = 65534;

 private:
  const CableGadget& gadget_;
  std::string folder_;
  std::unique_ptr<test::Process> nodald_;
};

}  // namespace nodal::hil
