// `nodal rigs` with an avahi-browse that prints what networks may hold, and without one.
#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class Rigs : public RigTest {
 protected:
  void avahi_does(const std::string& script) {
    fs::create_directory(path("bin"));
    write("bin/avahi-browse", "#!/bin/sh\n" + script);
    fs::permissions(path("bin/avahi-browse"), fs::perms::owner_all);
    environment_["PATH"] = path("bin") + ":/usr/bin:/bin";
  }
  static std::string line(const std::string& name, const std::string& host, const std::string& address,
                          const std::string& port) {
    return "=;eth0;IPv4;" + name + ";_nodal._tcp;local;" + host + ";" + address + ";" + port + ";\"\"\n";
  }
};

TEST_F(Rigs, InTheNetwork_AreListedOnceWithTheirAddressAndPage) {
  write("said", "+;eth0;IPv4;Nodal\\032rig\\032on\\032six;_nodal._tcp;local\n" +
                    line("Nodal\\032rig\\032on\\032six", "six.local", "2001:db8::7", "443") +
                    line("Nodal\\032rig\\032on\\032six", "six.local", "192.168.8.1", "443") +
                    line("another\\059one", "ten.local", "2001:db8::8", "8443"));
  avahi_does("case \"$*\" in *--resolve*--terminate*_nodal._tcp) cat " + path("said") + ";; esac\n");
  const Json found = nodal_json({"rigs"}).at(0);
  ASSERT_EQ(found["rigs"].size(), 2u) << found;
  EXPECT_EQ(found["rigs"][0],
            Json({{"name", "Nodal rig on six"}, {"address", "ssh://six.local"}, {"page", "https://192.168.8.1"}}));
  EXPECT_EQ(found["rigs"][1]["name"], "another;one");
  EXPECT_EQ(found["rigs"][1]["page"], "https://[2001:db8::8]:8443");
  const Finished table = nodal({"rigs"});
  EXPECT_EQ(table.code, 0);
  EXPECT_NE(table.out.find("ssh://six.local"), std::string::npos) << table.out;
}

TEST_F(Rigs, WhateverTheNetworkSays_IsNoOptionOfSshAndNoControlCharacter) {
  std::string said = line("\\027[31mred\\010", "red.local", "10.0.0.1", "443");
  for (const std::string host : {"-oProxyCommand=x", "a b", "a;b", "", "$(id)", "a/b", "user@host"})
    said += line("bad", host, "10.0.0.2", "443");
  for (const std::string port : {"0", "65536", "-1", "443x", ""}) said += line("bad", "bad.local", "10.0.0.3", port);
  said += line("bad", "bad.local", "10.0.0.4/evil", "443") + "=;;;\n=\n;;;;;;;;;;;;\n\\";
  for (int k = 0; k < 200; ++k) said += "\n" + line("n" + std::to_string(k), "many.local", "10.0.0.5", "443");
  write("said", said);
  avahi_does("cat " + path("said") + "\n");
  const Json found = nodal_json({"rigs"}).at(0);
  ASSERT_EQ(found["rigs"].size(), 64u) << "no more are kept";
  EXPECT_EQ(found["rigs"][0]["address"], "ssh://red.local");
  EXPECT_EQ(found["rigs"][0]["name"].get<std::string>().find('\x1B'), std::string::npos);
  EXPECT_EQ(found["rigs"][1]["address"], "ssh://many.local") << found["rigs"][1];
}

TEST_F(Rigs, WhereTheNetworkCannotBeSearched_ANoteSaysWhy) {
  const auto note = [&] { return nodal_json({"rigs"}).at(0)["notes"].dump(); };
  avahi_does("echo 'Failed to create client object: Daemon not running' >&2\nexit 1\n");
  EXPECT_NE(note().find("Daemon not running"), std::string::npos) << note();
  avahi_does("exec sleep 100\n");
  EXPECT_NE(nodal_json({"--timeout", "1s", "rigs"}).at(0)["notes"].dump().find("--timeout"), std::string::npos);
  avahi_does("exec yes " + line("n", "h.local", "10.0.0.5", "443").substr(0, 60) + "\n");
  EXPECT_NE(note().find("262144 bytes"), std::string::npos) << note();
  fs::remove(path("bin/avahi-browse"));
  environment_["PATH"] = path("bin");
  EXPECT_NE(note().find("apt install avahi-utils"), std::string::npos) << note();
}

}  // namespace
}  // namespace nodal::command_line
