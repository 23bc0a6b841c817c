// [links] of rig.toml: the sockets and the cable that hosts connect by.
#include <gtest/gtest.h>

#include <string>

#include "firmware/config/config.h"

namespace nodal::firmware {
namespace {

const std::string kRigOfOneHead = R"([rig]
name = "small"
[sim]
calibration = "truth.json"
[[heads]]
name = "cam0"
port = "sim:cam0"
)";

TEST(RigConfig, AnOperateSocket_HasAPathOfItsOwn) {
  const std::string links = kRigOfOneHead + "[links]\nview = \"/run/nodal/view.sock\"\n";
  const auto config = parse_rig_config(
      links + "operate = \"/run/nodal/operate.sock\"\noperate_mode = 0o660\noperate_group = \"video\"\n", "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->links.operate_path, "/run/nodal/operate.sock");
  EXPECT_EQ(config->links.operate_file.mode, 0660u);
  EXPECT_EQ(config->links.operate_file.group, "video");
  for (const std::string path : {"/run/nodal/nodal.sock", "/run/nodal/view.sock"}) {
    const auto same = parse_rig_config(links + "operate = \"" + path + "\"\n", "rig.toml");
    ASSERT_FALSE(same);
    EXPECT_NE(same.error().message.find("operate"), std::string::npos) << same.error().message;
  }
}

TEST(RigConfig, AUsbCable_IsTheFolderOfItsGadget) {
  const auto config = parse_rig_config(kRigOfOneHead + "[links]\nusb = \"/run/nodal_cable\"\n", "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->links.usb_folder, "/run/nodal_cable");
  EXPECT_FALSE(parse_rig_config(kRigOfOneHead + "[links]\nusb = true\n", "rig.toml"));
}

}  // namespace
}  // namespace nodal::firmware
