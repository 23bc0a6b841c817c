#include "tests/support/ssh_keys.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/support/process.h"

namespace nodal::test {
namespace {

void write(const std::string& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

std::string read(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void keygen(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{"ssh-keygen"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const Finished finished = Process(command).wait();
  EXPECT_EQ(finished.code, 0) << finished.err;
}

}  // namespace

SshKeys::SshKeys() {
  std::string folder = std::filesystem::temp_directory_path() / "nodal-keys-XXXXXX";
  folder_ = ::mkdtemp(folder.data());
}

SshKeys::~SshKeys() { std::filesystem::remove_all(folder_); }

std::string SshKeys::make(const std::string& name, const std::string& kind) {
  keygen({"-q", "-t", kind, "-N", "", "-C", name, "-f", folder_ + "/" + name});
  return read(folder_ + "/" + name + ".pub");
}

std::string SshKeys::sign(const std::string& name, const std::string& document, const std::string& name_space,
                          const std::string& hash) {
  const std::string file = folder_ + "/document";
  write(file, document);
  std::filesystem::remove(file + ".sig");
  keygen({"-Y", "sign", "-q", "-n", name_space, "-O", "hashalg=" + hash, "-f", folder_ + "/" + name, file});
  return read(file + ".sig");
}

bool SshKeys::verifies(const std::string& allowed_signers, const std::string& principal, const std::string& document,
                       const std::string& signature, const std::string& name_space) {
  write(folder_ + "/allowed", allowed_signers);
  write(folder_ + "/signature", signature);
  write(folder_ + "/document", document);
  // ssh-keygen reads the document from standard input, for which this needs a shell; all names here are our own.
  const std::string command = "exec ssh-keygen -Y verify -f " + folder_ + "/allowed -I " + principal + " -n '" +
                              name_space + "' -s " + folder_ + "/signature < " + folder_ + "/document";
  return Process({"sh", "-c", command}).wait().code == 0;
}

}  // namespace nodal::test
