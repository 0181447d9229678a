"""Other people's formats as streams of scans."""
