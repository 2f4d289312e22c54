"""What an archive consists of: its files, texts and checksums, whoever writes or reads them."""
