#!/usr/bin/env bash
# Builds ktx2check, Khronos' own validator of KTX2 (KTX-Software 4.0), into the folder that is named, from the sources that a crate brings along:
# no registry has the newer `ktx validate`. Some ten seconds.
set -euo pipefail
to="$(realpath -m "$1")"
cd "$(dirname "$0")"
sources="$(cargo metadata --locked --format-version 1 | python3 -c '
import json, os, sys
of = {package["name"]: package["manifest_path"] for package in json.load(sys.stdin)["packages"]}
print(os.path.join(os.path.dirname(of["libktx-rs-sys"]), "build", "KTX-Software"))')"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
flags=(-w -O0 -DLIBKTX -DKHRONOS_STATIC -DKTX_FEATURE_WRITE=0 -DSUPPORT_SOFTWARE_ETC_UNPACK=0)
for folder in include lib lib/basisu/transcoder lib/basisu/zstd lib/dfdutils other_include utils tools/ktx2check; do
    flags+=("-I$sources/$folder")
done
c=(lib/{checkheader,filestream,hashlist,info,memstream,strings,swap,texture,texture1,texture2,vkformat_check,vkformat_str}.c
    lib/dfdutils/{createdfd,colourspaces,interpretdfd,printdfd,queries,vk2dfd}.c lib/basisu/zstd/zstddeclib.c)
cpp=(lib/basis_transcode.cpp lib/basisu/transcoder/basisu_transcoder.cpp utils/argparser.cpp tools/ktx2check/ktx2check.cpp)
for file in "${c[@]}"; do "${CC:-cc}" "${flags[@]}" -c "$sources/$file" -o "$work/${file//\//_}.o"; done
for file in "${cpp[@]}"; do "${CXX:-c++}" -std=c++11 "${flags[@]}" -c "$sources/$file" -o "$work/${file//\//_}.o"; done
mkdir -p "$to"
"${CXX:-c++}" "$work"/*.o -o "$to/ktx2check" -lpthread
