#include "host_tool/rig/rig_address.h"

#include <gtest/gtest.h>

namespace nodal::host {
namespace {

using Words = std::vector<std::string>;

TEST(RigAddress, UnixPaths_GoToTheLinkAsTheyAre) {
  EXPECT_EQ(parse_rig_address("unix:/run/nodal/nodal.sock", "ssh")->link, "unix:/run/nodal/nodal.sock");
  EXPECT_EQ(parse_rig_address("/run/nodal/nodal.sock", "ssh")->link, "unix:/run/nodal/nodal.sock");
  EXPECT_EQ(parse_rig_address("unix:here.sock", "ssh")->link, "unix:here.sock");
}

TEST(RigAddress, Usb_GoesToTheLinkWithItsSerialOrWithout) {
  EXPECT_EQ(parse_rig_address("usb:", "ssh")->link, "usb:");
  EXPECT_EQ(parse_rig_address("usb:RIG7", "ssh")->link, "usb:RIG7");
  EXPECT_TRUE(parse_rig_address("usb:RIG7", "ssh")->command.empty());
}

TEST(RigAddress, SshInAllItsForms_BecomesTheCommandThatBridges) {
  EXPECT_EQ(parse_rig_address("ssh://rig.local", "ssh")->command,
            (Words{"ssh", "-T", "rig.local", "nodald", "--bridge"}));
  EXPECT_EQ(parse_rig_address("ssh://ann@rig:2222/", "/opt/ssh")->command,
            (Words{"/opt/ssh", "-T", "-p", "2222", "ann@rig", "nodald", "--bridge"}));
  EXPECT_EQ(parse_rig_address("ssh://[fe80::1]:22", "ssh")->command,
            (Words{"ssh", "-T", "-p", "22", "fe80::1", "nodald", "--bridge"}));
}

TEST(RigAddress, HostThatSshWouldTakeForAnOption_IsRefused) {
  for (const char* text : {"ssh://-oProxyCommand=reboot", "ssh://-l@host", "ssh://a b", "ssh://host;reboot",
                           "ssh://$(reboot)", "ssh://host/path"}) {
    EXPECT_FALSE(parse_rig_address(text, "ssh")) << text;
  }
}

TEST(RigAddress, UserOrHostWithACharacterOutsideTheAllowedOnes_IsRefused) {
  for (const char* text :
       {"ssh://ann;id@rig", "ssh://$USER@rig", "ssh://an n@rig", "ssh://ann%h@rig", "ssh://a\nb@rig", "ssh://rig%20x",
        "ssh://rig*", "ssh://rig?", "ssh://rig#1", "ssh://r\xc3\xb6g", "ssh://rig\x01", "ssh://a,b", "ssh://a=b",
        "ssh://{a}", "ssh://a!b", "ssh://~a", "ssh://[fe80::1;id]", "ssh://[-oProxyCommand=id]", "ssh://[fe80::1\n]"}) {
    const auto address = parse_rig_address(text, "ssh");
    ASSERT_FALSE(address) << text;
    EXPECT_EQ(address.error().code, Errc::kBadValue) << text;
  }
  for (const char* text : {"ssh://first.last+rig@rig-7_b.example.org", "ssh://192.168.0.5", "ssh://[fe80::1%eth0]"}) {
    EXPECT_TRUE(parse_rig_address(text, "ssh")) << text;
  }
}

TEST(RigAddress, Tcp_IsRefusedWithTheWayThatIsAllowed) {
  for (const char* text : {"tcp:127.0.0.1:7700", "tcp:[::1]:7700", "tcp:192.168.0.5:7700"}) {
    const auto address = parse_rig_address(text, "ssh");
    ASSERT_FALSE(address) << text;
    EXPECT_EQ(address.error().code, Errc::kBadValue);
    EXPECT_NE(address.error().message.find("ssh://"), std::string::npos);
  }
}

TEST(RigAddress, WhatIsNoAddress_IsRefusedWithTheForms) {
  for (const char* text : {"", "unix:", "tcp:127.0.0.1", "tcp:127.0.0.1:x", "ssh://", "ssh://host:", "ssh://@host",
                           "ssh://[fe80::1", "ssh://[::1]x", "ssh://host:0", "http://rig", "rig.local"}) {
    const auto address = parse_rig_address(text, "ssh");
    ASSERT_FALSE(address) << text;
    EXPECT_EQ(address.error().code, Errc::kBadValue) << text;
    EXPECT_NE(address.error().message.find("unix:PATH"), std::string::npos) << text;
  }
}

TEST(RigAddress, SocketPathLongerThanTheKernelTakes_IsRefusedBeforeItIsTried) {
  EXPECT_TRUE(parse_rig_address("unix:" + std::string(107, 'a'), "ssh"));
  const auto address = parse_rig_address("unix:" + std::string(108, 'a'), "ssh");
  ASSERT_FALSE(address);
  EXPECT_NE(address.error().message.find("107"), std::string::npos);
}

}  // namespace
}  // namespace nodal::host
