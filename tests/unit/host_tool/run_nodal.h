// Runs `nodal` in this process, like a user.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"

namespace nodal::host {

/// The result of one run, with its output.
struct Outcome {
  explicit Outcome(const std::vector<std::string>& words) {
    std::vector<const char*> all{"nodal"};
    for (const std::string& word : words) all.push_back(word.c_str());
    std::FILE* out_file = std::tmpfile();
    std::FILE* err_file = std::tmpfile();
    Console console(out_file, err_file);
    ::setenv("NODAL_OVERWRITE", "1", 0);
    CommandLine line(console, add_all_commands);
    code = line.run(static_cast<int>(all.size()), all.data());
    out = content_of(out_file);
    err = content_of(err_file);
    std::fclose(out_file);
    std::fclose(err_file);
  }
  ExitCode code;
  std::string out, err;

 private:
  static std::string content_of(std::FILE* file) {
    std::string text;
    std::rewind(file);
    for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) text.push_back(static_cast<char>(c));
    return text;
  }
};

}  // namespace nodal::host
