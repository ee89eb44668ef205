// Makes a folder with the example asset and scene:  write_example_scene FOLDER
#include <cstdio>

#include "example_scene.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: write_example_scene FOLDER\n", stderr);
    return 2;
  }
  std::filesystem::create_directories(argv[1]);
  limber::testing::write_example_scene(argv[1]);
}
